# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Estimates and tests are those of the literature."""

from __future__ import annotations

import numpy as np
import pytest

from dsse_ros.campaign.config import Campaign
from dsse_ros.campaign.estimates import clusters, of_mean, of_median, of_share, signs_p
from dsse_ros.campaign.statistics import (
    Played,
    holm,
    horizon_of,
    pairs,
    pos_at,
    restricted_s,
)

CAMPAIGN = Campaign.from_dict(
    {"planners": ["greedy", "sweep"], "scenarios": [{"grid_size": 8, "timestep_limit": 20}]}
)
CASE = CAMPAIGN.cases[0]


def played(planner: str, found: list[bool], steps: list[int]) -> Played:
    hit, taken = np.array(found), np.array(steps, float)
    none = np.zeros(len(hit))
    time_s = np.where(hit, taken * CASE.scenario.step_duration_s, np.inf)
    return Played(
        planner,
        CASE,
        np.arange(len(hit)),
        none.astype(int) - 1,
        hit,
        taken,
        time_s,
        none,
        none,
        none,
    )


def test_an_interval_of_a_share_is_wilsons() -> None:
    share = of_share(np.arange(20) < 3, 0.95)
    # By hand: (p + z^2 / 2 n -+ z sqrt(p q / n + z^2 / 4 n^2)) / (1 + z^2 / n).
    assert (share.low, share.high) == pytest.approx((0.0523686, 0.3604188), abs=1e-6)


def test_an_interval_of_a_mean_is_students() -> None:
    mean = of_mean(np.array([1.0, 2.0, 3.0, 4.0, 5.0]), 0.95)
    assert mean.high - mean.value == pytest.approx(2.776445 * (2.5 / 5) ** 0.5, abs=1e-5)
    assert of_mean(np.array([7.0]), 0.95).high == np.inf


def test_an_interval_of_a_median_is_between_order_statistics() -> None:
    median = of_median(np.arange(1.0, 11.0), 0.95)
    # The second and the ninth of ten hold it with 97.9 %, a step further in is too little.
    assert (median.low, median.value, median.high) == (2, 5.5, 9)


def test_medians_are_covered_as_often_as_the_level_promises() -> None:
    rng = np.random.default_rng(1)
    intervals = [of_median(rng.exponential(size=41), 0.9) for _ in range(1000)]
    assert np.mean([one.low <= np.log(2) <= one.high for one in intervals]) > 0.88


def test_a_restricted_mean_is_the_area_under_the_curve_of_those_not_yet_found() -> None:
    one = played("greedy", [True, True, False, True], [3, 8, 20, 15])
    step = CASE.scenario.step_duration_s
    horizon = 10 * step
    missing = [1 - pos_at(one, k * step, 0.95).value for k in range(10)]
    assert restricted_s(one, horizon).mean() == pytest.approx(sum(missing) * step)
    assert horizon_of(CAMPAIGN, CASE) == 20 * step


def test_planners_are_compared_on_the_same_seeds() -> None:
    a = played("greedy", [True] * 10 + [False] * 2, [5] * 10 + [20] * 2)
    b = played("sweep", [True] * 2 + [False] * 9 + [True], [9] * 2 + [20] * 9 + [9])
    (pair,) = pairs(CAMPAIGN, [a, b])
    assert (pair.only_first, pair.only_second) == (8, 1)
    assert pair.found.value == pytest.approx(7 / 12)
    # 2 (C(9, 0) + C(9, 1)) / 2^9
    assert pair.found_p == pytest.approx(20 / 512)
    assert 0 < pair.time_p < 0.05 and pair.time_s.value < 0


def test_planners_that_do_alike_do_not_differ() -> None:
    a = played("greedy", [True] * 5, [5] * 5)
    (pair,) = pairs(CAMPAIGN, [a, a])
    assert (pair.found_p, pair.time_p, pair.time_s.value) == (1, 1, 0)


def test_p_values_are_adjusted_by_holm() -> None:
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([]) == []

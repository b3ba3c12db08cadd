# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Estimates and tests are those of the literature."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from dsse_ros.results.campaign.config import Campaign
from dsse_ros.results.campaign.estimates import (
    Estimate,
    clusters,
    of_mean,
    of_median,
    of_share,
    of_share_difference,
    signs_p,
)
from dsse_ros.results.campaign.statistics import (
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


def played(
    planner: str, found: list[bool], steps: list[int], seeds: list[int] | None = None
) -> Played:
    hit, taken = np.array(found), np.array(steps, float)
    drawn = np.array(seeds or [-1] * len(hit))
    none = np.zeros(len(hit))
    time_s = np.where(hit, taken * CASE.scenario.step_duration_s, np.inf)
    return Played(
        planner,
        CASE,
        np.arange(len(hit)),
        drawn,
        hit,
        taken,
        time_s,
        none,
        none,
        none,
    )


def test_an_interval_of_a_share_is_wilsons() -> None:
    # Newcombe 1998, table I, method 3.
    for hits, count, low, high in (
        (81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ):  # fmt: skip
        share = of_share(np.arange(count) < hits, 0.95, np.arange(count))
        assert (share.low, share.high) == pytest.approx((low, high), abs=5e-5)


def test_an_interval_of_a_share_holds_the_share() -> None:
    for size in range(1, 100):
        for hits in (0, 1, size):
            share = of_share(np.arange(size) < hits, 0.95, np.arange(size))
            assert 0 <= share.low <= share.value <= share.high <= 1


def test_an_interval_of_a_mean_is_students() -> None:
    mean = of_mean(np.array([1.0, 2.0, 3.0, 4.0, 5.0]), 0.95, np.arange(5))
    assert mean.high - mean.value == pytest.approx(2.776445 * (2.5 / 5) ** 0.5, abs=1e-5)
    assert of_mean(np.array([7.0]), 0.95, np.arange(1)).high == np.inf


def test_an_interval_of_a_median_is_between_order_statistics() -> None:
    median = of_median(np.arange(1.0, 11.0), 0.95, np.arange(10))
    # The second and the ninth of ten hold it with 97.9 %, a step further in is too little.
    assert (median.low, median.value, median.high) == (2, 5.5, 9)


def test_medians_are_covered_as_often_as_the_level_promises() -> None:
    rng = np.random.default_rng(1)
    intervals = [of_median(rng.exponential(size=41), 0.9, np.arange(41)) for _ in range(1000)]
    assert np.mean([interval.low <= np.log(2) <= interval.high for interval in intervals]) > 0.88


def test_a_restricted_mean_is_the_area_under_the_curve_of_those_not_yet_found() -> None:
    missions = played("greedy", [True, True, False, True], [3, 8, 20, 15])
    step = CASE.scenario.step_duration_s
    horizon = 10 * step
    missing = [1 - pos_at(missions, k * step, 0.95).value for k in range(10)]
    assert restricted_s(missions, horizon).mean() == pytest.approx(sum(missing) * step)
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


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("share", [False, True])
def test_planners_that_all_find_the_person_may_yet_differ(share: bool, shared: bool) -> None:
    hits, alone = np.full(500, share), np.arange(500)
    labels = alone // 5 if shared else alone
    found = of_share_difference(hits, hits, 0.95, (labels, labels))
    reach = 1 - of_share(np.ones(500, bool), 0.95, labels).low
    assert found.value == 0
    assert (found.low, found.high) == pytest.approx((-reach, reach))
    assert reach > 0.007


def test_the_interval_of_a_difference_is_newcombes() -> None:
    """Method 10 of Newcombe 1998, with the 50 pairs of its examples."""
    both, first, second, neither = 20, 12, 2, 16
    a = np.repeat([True, True, False, False], [both, first, second, neither])
    b = np.repeat([True, False, True, False], [both, first, second, neither])
    alone = np.arange(50)
    found = of_share_difference(a, b, 0.95, (alone, alone))
    assert found.value == pytest.approx(0.2)
    assert (found.low, found.high) == pytest.approx((0.0562, 0.3290), abs=2e-3)
    swapped = of_share_difference(b, a, 0.95, (alone, alone))
    assert (swapped.low, swapped.high) == pytest.approx((-found.high, -found.low))


@pytest.mark.slow
@pytest.mark.parametrize("low", [0.5, 0.95, 0.99])
def test_differences_of_shares_are_covered_as_often_as_the_level_promises(low: float) -> None:
    rng, alone = np.random.default_rng(6), np.arange(100)
    covered = []
    for _ in range(1000):
        drawn = rng.random((2, 100)) * 0.5 + 0.5 * rng.random(100)
        # The median of the mean of two uniform numbers is .5, its quantiles those of a triangle.
        bound = np.sqrt(low / 2) if low <= 0.5 else 1 - np.sqrt((1 - low) / 2)
        hits = drawn < bound
        found = of_share_difference(hits[0], hits[1], 0.95, (alone, alone))
        covered.append(found.low <= 0 <= found.high)
    assert np.mean(covered) > 0.93


def test_p_values_are_adjusted_by_holm() -> None:
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([]) == []


SIZES = st.lists(st.integers(0, 5), min_size=3, max_size=40)


@pytest.mark.slow
@given(SIZES, st.randoms(use_true_random=False))
def test_clusters_of_one_mission_each_change_nothing(values: list[int], random: Random) -> None:
    numbers = np.array(values, float)
    count = len(values)
    alone = np.array(random.sample(range(count), count))
    mean = of_mean(numbers, 0.9, alone)
    student = stats.t(count - 1, numbers.mean(), stats.sem(numbers) or 1e-300)
    assert (mean.low, mean.high) == pytest.approx(student.interval(0.9))
    wilson = stats.binomtest(int((numbers > 2).sum()), count).proportion_ci(0.9, "wilson")
    share = of_share(numbers > 2, 0.9, alone)
    assert (share.low, share.high) == pytest.approx((wilson.low, wilson.high))
    assert of_median(numbers, 0.9, alone) == of_median(numbers, 0.9, np.arange(count))


@given(SIZES, st.integers(2, 6))
def test_missions_played_again_with_the_same_draws_say_nothing_more(
    values: list[int], times: int
) -> None:
    once, again = np.array(values, float), np.repeat(values, times).astype(float)
    labels = np.repeat(np.arange(len(values)), times)
    alone = np.arange(len(values))
    one, more = of_mean(once, 0.9, alone), of_mean(again, 0.9, labels)
    assert (more.value, more.low, more.high) == pytest.approx((one.value, one.low, one.high))
    share, shares = of_share(once > 2, 0.9, alone), of_share(again > 2, 0.9, labels)
    assert shares.value == pytest.approx(share.value)
    # Student's quantile stands in place of the normal one.
    assert shares.low <= share.low + 1e-9 and shares.high >= share.high - 1e-9


def test_missions_of_one_seed_say_nothing_of_others() -> None:
    one = np.zeros(1000, np.int64)
    assert of_share(one > 0, 0.95, one) == Estimate(0, 0, 1)
    assert of_mean(np.arange(1000.0), 0.95, one).high == np.inf
    assert signs_p(np.ones(1000), one, one) == 1
    a = played("greedy", [True] * 30, [5] * 30, [4] * 30)
    (pair,) = pairs(CAMPAIGN, [a, played("sweep", [False] * 30, [20] * 30)])
    assert (pair.only_first, pair.found_p, pair.time_p) == (30, 1, 1)
    # A mean of one cluster has no bound, a difference of shares has these.
    assert (pair.found.low, pair.found.high, pair.time_s.high) == (-1, 1, np.inf)


def test_missions_that_drew_nothing_are_independent_of_one_another() -> None:
    a, b, c, d, e = clusters(np.array([-1, 3, -1, 3, 0])).tolist()
    assert b == d and len({a, b, c, e}) == 4


DEALT = np.arange(400) % 20
"""Clusters of 20 missions each."""


def drawn(rng: np.random.Generator, spread: float) -> NDArray[np.float64]:
    """Return 400 values of mean 0, of which each cluster shares a part."""
    values: NDArray[np.float64] = rng.normal(size=400) + spread * rng.normal(size=20)[DEALT]
    return values


@pytest.mark.slow
def test_intervals_of_clusters_hold_as_often_as_the_level_promises() -> None:
    rng = np.random.default_rng(3)
    samples = [drawn(rng, 1.0) for _ in range(1000)]
    means = [of_mean(values, 0.9, DEALT) for values in samples]
    shares = [of_share(values < 0, 0.9, DEALT) for values in samples]
    medians = [of_median(values, 0.9, DEALT) for values in samples]
    assert np.mean([mean.low <= 0 <= mean.high for mean in means]) == pytest.approx(0.9, abs=0.03)
    assert 0.88 < np.mean([share.low <= 0.5 <= share.high for share in shares]) < 0.96
    assert 0.86 < np.mean([median.low <= 0 <= median.high for median in medians]) < 0.96
    # As if missions were independent, they do not.
    plain = [of_mean(values, 0.9, np.arange(400)) for values in samples]
    assert np.mean([interval.low <= 0 <= interval.high for interval in plain]) < 0.6


@pytest.mark.slow
def test_pairs_of_planners_with_other_seeds_hold_as_often_as_the_level_promises() -> None:
    rng = np.random.default_rng(4)
    other = np.arange(400) // 16
    samples = [drawn(rng, 0.7) + 0.7 * rng.normal(size=25)[other] for _ in range(1000)]
    means = [of_mean(values, 0.9, DEALT, other) for values in samples]
    assert np.mean([mean.low <= 0 <= mean.high for mean in means]) == pytest.approx(0.9, abs=0.04)


@pytest.mark.slow
@pytest.mark.parametrize("of", [np.sign, lambda x: np.sign(x) * stats.rankdata(abs(x))])
def test_planners_that_differ_by_their_seeds_only_are_seldom_found_to_differ(
    of: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> None:
    rng = np.random.default_rng(5)
    p = [signs_p(of(drawn(rng, 1.0)), DEALT, np.arange(400)) for _ in range(1000)]
    assert 0.01 < np.mean(np.array(p) < 0.05) < 0.05
    # As if missions were independent, they are.
    p = [signs_p(of(drawn(rng, 1.0)), np.arange(400)) for _ in range(1000)]
    assert np.mean(np.array(p) < 0.05) > 0.3
    assert signs_p(of(drawn(rng, 1.0) + 3), DEALT, DEALT) < 1e-3

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The line on top of a campaign's report names the best planner, if one is better beyond chance."""

from __future__ import annotations

from typing import Any

import pytest

from dsse_ros.results.campaign.estimates import Estimate
from dsse_ros.results.campaign.report import verdict
from dsse_ros.results.campaign.statistics import PlannerPair

SHARES = {"sweep": 0.8, "greedy": 0.92}


def pair(**fields: Any) -> PlannerPair:
    values = {
        "case": None, "first": "sweep", "second": "greedy", "only_first": 1, "only_second": 13,
        "found": Estimate(-0.12, -0.2, -0.04), "found_p": 0.001,
        "time_s": Estimate(90.0, 60.0, 120.0), "time_p": 0.001,
    }  # fmt: skip
    return PlannerPair(**(values | fields))


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({}, "greedy finds everyone in 92.0% of its missions, 12.0 percentage points more than"),
        ({"found_p": 0.06}, "no difference beyond chance, but greedy is faster by"),
        ({"found_p": 0.06, "time_p": 0.06}, "beyond chance, nor in the time to detection."),
    ],
)
def test_the_best_planner_is_named_only_if_it_is_better_beyond_chance(
    fields: dict[str, Any], says: str
) -> None:
    assert says in verdict([pair(**fields)], SHARES, 0.05)


def test_a_planner_alone_is_compared_with_none() -> None:
    assert verdict([], {"greedy": 0.5}, 0.05) == "greedy finds everyone in 50.0% of its missions."

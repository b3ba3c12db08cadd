# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A unit uses the time it has and no more, and no two units search the same place."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.planners.search_plan.assignments import Choice, SearchUnit, assignment_of
from dsse_ros.planners.search_plan.divisions import Cloud, bounds_of, divided
from dsse_ros.planners.search_plan.rectangles import gap_m
from dsse_ros.world.sensors.lateral_range import LateralRange

DRONE = SearchUnit("drone", 10.0, (0.0, 0.0), 60.0, 2000.0, LateralRange(65.0, 1.0))

choices = st.builds(
    Choice, st.floats(-3000, 3000), st.floats(-3000, 3000), st.floats(0, 360), st.booleans(),
    st.integers(1, 20), st.floats(20, 400),
)  # fmt: skip


@given(
    choices, st.sampled_from([math.inf, 900.0, 1500.0]), st.sampled_from([math.inf, 700.0]),
    st.sampled_from([0.0, 8.0]),
)  # fmt: skip
def test_a_unit_has_time_for_its_track_with_its_turns_and_none_left(
    choice: Choice, endurance_s: float, on_scene_s: float, turn_s: float
) -> None:
    unit = SearchUnit(
        "drone", 10.0, (0.0, 0.0), 60.0, 2000.0, LateralRange(65.0, 1.0), on_scene_s, endurance_s,
        turn_s=turn_s,
    )  # fmt: skip
    laid = assignment_of(unit, choice)
    if laid is None:
        return
    left_s = min(
        unit.until_s - laid.ends_s, on_scene_s - (laid.ends_s - laid.commences_s),
        unit.ready_s + endurance_s - laid.returns_s if unit.returns else math.inf,
    )  # fmt: skip
    assert left_s == pytest.approx(0.0, abs=1e-3)
    assert len(laid.track) == 2 * choice.lanes
    assert laid.search.track.times_s[[0, -1]].tolist() == pytest.approx(
        [laid.commences_s, laid.ends_s]
    )
    legs, pauses = np.hypot(*np.diff(laid.search.track.points, axis=0).T), laid.search.track.times_s
    assert np.diff(pauses) == pytest.approx(np.where(legs > 0, legs / 10.0, turn_s))
    assert laid.length_m == pytest.approx(float(np.hypot(*np.diff(laid.track, axis=0).T).sum()))


@given(choices)
def test_a_track_stays_half_a_spacing_inside_its_area(choice: Choice) -> None:
    laid = assignment_of(DRONE, choice)
    if laid is None:
        return
    inner = laid.area._replace(
        along=laid.area.along - 0.999 * choice.spacing_m,
        across=laid.area.across - 0.999 * choice.spacing_m,
    )
    assert inner.contains(laid.track).all()


def test_a_unit_that_does_not_creep_gets_no_creeping_line() -> None:
    choice = Choice(2000.0, 0.0, 0.0, False, 20, 300.0)
    laid = assignment_of(DRONE, choice)
    assert laid is not None
    assert laid.pattern == "CS"
    sweeper = SearchUnit(
        "plane", 10.0, (0.0, 0.0), 60.0, 2000.0, LateralRange(65.0, 1.0), patterns=("PS",)
    )
    assert assignment_of(sweeper, choice) is None


@settings(max_examples=200)
@given(st.integers(1, 5), st.integers(0, 2**32 - 1))
def test_the_areas_of_a_division_never_overlap(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    units = [
        SearchUnit(
            str(n), rng.uniform(5, 40), (0.0, 100.0 * n), 0.0, rng.uniform(1000, 3000),
            LateralRange(rng.uniform(30, 300), 1.0),
        )
        for n in range(count)
    ]  # fmt: skip
    cloud = Cloud(np.array([1000.0, 1500.0]), np.diag([4e5, 1e6]))
    low, high = bounds_of(units, cloud).T
    plan = divided(units, rng.uniform(low, high))
    if plan is not None:
        for a, b in itertools.combinations(plan, 2):
            assert gap_m(a.area, b.area) > -1e-6

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The flight model keeps its limits and comes to rest where it should."""

from __future__ import annotations

import math

from autopilot.local_frame import LocalFrame, Place, Point
from autopilot.point_mass import Limits, PointMass
from hypothesis import given, settings
from hypothesis import strategies as st

DT_S = 0.02

coordinates = st.floats(-100, 100)
points = st.builds(Point, coordinates, coordinates, st.floats(0, 50))
limits = st.builds(
    Limits, st.floats(1, 20), st.floats(0.5, 5), st.floats(0.5, 5), st.floats(0.5, 5),
    st.floats(0.5, 5),
)  # fmt: skip


@given(targets=st.lists(points, min_size=1, max_size=4), limits=limits)
def test_no_limit_is_broken_however_the_target_changes(
    targets: list[Point], limits: Limits
) -> None:
    craft = PointMass()
    for target in targets:
        for _ in range(100):
            before = (craft.north_mps, craft.east_mps, craft.up_mps)
            craft.fly_towards(target, limits, DT_S)
            change = math.hypot(craft.north_mps - before[0], craft.east_mps - before[1])
            assert change <= limits.acceleration_mps2 * DT_S * (1 + 1e-9)
            assert abs(craft.up_mps - before[2]) <= limits.vertical_mps2 * DT_S * (1 + 1e-9)
            assert craft.ground_speed_mps <= limits.speed_mps * (1 + 1e-9)
            assert -limits.descent_mps <= craft.up_mps <= limits.climb_mps


@settings(max_examples=40)
@given(target=points, limits=limits)
def test_it_comes_to_rest_on_its_target_without_passing_it(target: Point, limits: Limits) -> None:
    craft = PointMass()
    way_m = craft.distance_m(target)
    longest_s = max(way_m / limits.speed_mps, target.up_m / limits.climb_mps) + 60
    for _ in range(int(longest_s / DT_S)):
        craft.fly_towards(target, limits, DT_S)
        assert math.hypot(*craft.point[:2]) <= way_m + 0.05
        assert craft.up_m <= target.up_m + 0.05
        if craft.distance_m(target) < 0.01 and abs(craft.up_m - target.up_m) < 0.01:
            break
    else:
        raise AssertionError(f"{craft.point} is not {target}")
    for _ in range(100):
        craft.fly_towards(target, limits, DT_S)
    assert craft.distance_m(target) < 0.05
    assert craft.ground_speed_mps < 0.05


@given(
    home=st.builds(Place, st.floats(-80, 80), st.floats(-180, 180), st.just(0.0)),
    north_m=st.floats(-50e3, 50e3),
    east_m=st.floats(-50e3, 50e3),
)
def test_metres_and_degrees_are_there_and_back_the_same(
    home: Place, north_m: float, east_m: float
) -> None:
    frame = LocalFrame(home)
    there = frame.geodetic(north_m, east_m)
    assert -180 <= there[1] <= 180
    back = frame.horizontal(*there)
    assert math.dist(back, (north_m, east_m)) < 1e-4

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions that fly where a drone went and look where it searched."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.base.result import Accepted
from dsse_ros.vehicles.fleet.fence import Fence, check_mission
from dsse_ros.vehicles.mission_items.items import (
    FRAME_GLOBAL,
    FRAME_GLOBAL_RELATIVE_ALT,
    FRAME_MISSION,
    NAV_RETURN_TO_LAUNCH,
    NAV_TAKEOFF,
    NAV_WAYPOINT,
    Home,
)
from dsse_ros.vehicles.mission_items.reduced_tracks import corners, stops, without_repeats
from dsse_ros.vehicles.mission_items.track_missions import TrackStyle, track_mission
from dsse_ros.world.scenario.frames import GridFrame, cell_to_map
from dsse_ros.world.scenario.geodesy import geodetic_to_map

FRAME = GridFrame(20, 130.0, -24.04, -46.17, 0.0, 120.0)
CELLS = st.lists(st.tuples(st.integers(0, 19), st.integers(0, 19)), min_size=1, max_size=12)
STRAIGHT = [(0, 0), (1, 0), (2, 0), (3, 0), (3, 1)]


def place(item):
    """Return the cell of a waypoint, whose altitude does not move it."""
    x_m, y_m, _ = geodetic_to_map(FRAME, item.lat_deg, item.lon_deg, 120.0)
    col, row = x_m / 130 - 0.5, 19 - (y_m / 130 - 0.5)
    assert (col, row) == pytest.approx((round(col), round(row)), abs=1e-5)
    return round(col), round(row)


@given(CELLS)
def test_a_track_is_take_off_each_cell_once_and_the_return(cells):
    mission = track_mission(FRAME, np.array(cells), style=TrackStyle(acceptance_radius_m=20))
    takeoff, *waypoints, back = mission.items
    first = (*cell_to_map(FRAME, *cells[0]), 0.0)
    assert geodetic_to_map(FRAME, *mission.home) == pytest.approx(first, abs=1e-3)
    assert (takeoff.command, takeoff.alt_m) == (NAV_TAKEOFF, 120.0)
    assert (takeoff.lat_deg, takeoff.lon_deg) == mission.home[:2]
    assert (back.command, back.frame) == (NAV_RETURN_TO_LAUNCH, FRAME_MISSION)
    assert [place(item) for item in waypoints] == [tuple(c) for c in without_repeats(cells)]
    for item in waypoints:
        assert (item.command, item.frame) == (NAV_WAYPOINT, FRAME_GLOBAL_RELATIVE_ALT)
        assert (item.param1, item.param2, item.alt_m) == (0.0, 20.0, 120.0)
        assert math.isnan(item.param4)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("merge_legs", [False, True])
def test_no_waypoint_and_no_leg_lies_in_a_cell_that_the_drone_was_not_in(seed, merge_legs):
    rng = np.random.default_rng(seed)
    cells = [(10, 10)]
    for _ in range(60):
        # A drone flies a while in one direction; diagonal legs pass between cells at a corner.
        dx, dy = rng.integers(-1, 2, 2)
        for _ in range(rng.integers(1, 6)):
            cells.append(tuple(int(c) for c in np.clip(np.add(cells[-1], (dx, dy)), 0, 19)))
    flown = {tuple(cell) for cell in cells}
    area = tuple("".join("1" if (c, r) in flown else "0" for c in range(20)) for r in range(20))
    mission = track_mission(
        FRAME, cells, rng.random(len(cells)) < 0.2, style=TrackStyle(merge_legs, datum_amsl_m=0.0)
    )
    fence = Fence(FRAME, margin_m=0.0, min_amsl_m=30.0, max_amsl_m=120.0, area=area)
    assert isinstance(
        check_mission(mission.numbered(home_first=False), fence, home_first=False), Accepted
    )
    stops_at = np.array([place(item) for item in mission.items[1:-1]], float)
    for start, end in zip(stops_at, stops_at[1:], strict=False):
        for share in np.linspace(0, 1, 97):
            col, row = start + share * (end - start) + 0.5
            if min(col % 1, 1 - col % 1) > 1e-3 and min(row % 1, 1 - row % 1) > 1e-3:
                assert (int(col), int(row)) in flown


@pytest.mark.slow
@given(CELLS, st.booleans(), st.data())
def test_a_search_is_a_descent_a_hold_and_a_climb_over_its_cell(cells, merge_legs, data):
    steps = [(cell, searched) for cell in cells for searched in [False, *data.draw(FLAGS)]]
    track, searched = zip(*steps, strict=True)
    mission = track_mission(
        FRAME,
        track,
        searched,
        style=TrackStyle(merge_legs, 10.0, search_alt_m=15.0, search_hold_s=7.0),
    )
    items = iter(mission.items[1:-1])
    where, times = stops(track, searched, merge_legs=merge_legs)
    for cell, n in zip(where.tolist(), times.tolist(), strict=True):
        over = [next(items) for _ in range(3 if n else 1)]
        assert {place(item) for item in over} == {tuple(cell)}
        assert [item.alt_m for item in over] == [120.0, 15.0, 120.0][: len(over)]
        assert [item.param1 for item in over] == [0.0, 7.0 * n, 0.0][: len(over)]
        assert {item.param2 for item in over} == {10.0}
    assert next(items, None) is None


FLAGS = st.lists(st.just(True), max_size=3)


def test_a_straight_leg_may_be_flown_in_one():
    one_per_cell = track_mission(FRAME, STRAIGHT).items[1:-1]
    merged = track_mission(FRAME, STRAIGHT, style=TrackStyle(merge_legs=True)).items[1:-1]
    assert [place(item) for item in one_per_cell] == STRAIGHT
    assert [place(item) for item in merged] == [(0, 0), (3, 0), (3, 1)]
    assert [list(place(item)) for item in merged] == corners(STRAIGHT).tolist()


def test_a_search_on_a_straight_leg_is_not_lost():
    cells = [(0, 0), (1, 0), (1, 0), (2, 0)]
    items = track_mission(FRAME, cells, [False, False, True, False], style=TrackStyle(True)).items
    assert [place(item) for item in items[1:-1]] == [(0, 0), (1, 0), (1, 0), (1, 0), (2, 0)]


def test_home_has_the_first_number_where_an_autopilot_wants_it():
    mission = track_mission(FRAME, [(0, 0)], home=Home(-24.0, -46.3, 4.0))
    home, *items = mission.numbered(home_first=True)
    assert (home.command, home.frame) == (NAV_WAYPOINT, FRAME_GLOBAL)
    assert (home.lat_deg, home.lon_deg, home.alt_m) == (-24.0, -46.3, 4.0)
    assert items == mission.numbered(home_first=False) == list(mission.items)
    assert (items[0].lat_deg, items[0].lon_deg) == (-24.0, -46.3)


@pytest.mark.slow
@given(CELLS, st.booleans())
def test_every_mission_in_the_area_is_inside_its_fence(cells, merge_legs):
    searched = [True] * len(cells)
    mission = track_mission(FRAME, cells, searched, style=TrackStyle(merge_legs, datum_amsl_m=0.0))
    fence = Fence(FRAME, margin_m=0.0, min_amsl_m=30.0, max_amsl_m=120.0)
    for home_first in (False, True):
        items = mission.numbered(home_first=home_first)
        assert check_mission(items, fence, home_first=home_first) == Accepted(tuple(items))


def test_an_empty_track_is_refused():
    with pytest.raises(ValueError, match="^cells must be "):
        track_mission(FRAME, [])


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("acceptance_radius_m", math.nan),
        ("acceptance_radius_m", 256.0),
        ("search_alt_m", 121.0),
        ("search_hold_s", math.inf),
    ],
)
def test_numbers_that_no_autopilot_would_take_are_refused(option, value):
    with pytest.raises(ValueError, match=f"^{option} must be "):
        track_mission(FRAME, [(0, 0)], style=TrackStyle(**{option: value}))

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the search patterns in metres about a drifting datum, and of the drones on them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import kernel
from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.planners.metres_patterns import (
    LAYOUTS,
    Datum,
    Layout,
    TrackGuidance,
    tracks_along,
    tracks_of,
)
from dsse_ros.planners.metres_planners import goals_on_map
from dsse_ros.planners.patterns import SearchPattern
from dsse_ros.search.step.metres_paths import AIRFRAMES, MOTION_STATES, Wind, pieces_of, write_path
from dsse_ros.search.step.metres_steering import steer
from dsse_ros.search.step.polylines import along, points_at

Floats = NDArray[np.float64]

STEP_S, CRUISE, SPACING, SIDE = 13.0, 10.0, 130.0, 8000.0
NAMES = sorted(LAYOUTS)


@kernel
def fly(airframes, wind, flights, n, action, path):  # type: ignore[no-untyped-def]
    """Fly drone n by a turn in radians and an airspeed."""
    write_path(airframes[n], wind, flights[n], action[0], action[1], path)


def layout_of(drones: int, length_m: float = 15000.0, ratio: float = 2.0) -> Layout:
    turned = np.array([(0.6, -0.8), (0.8, 0.6)])
    covariance = turned @ np.diag([ratio**2, 1.0]) @ turned.T * 300**2
    return Layout(drones, SPACING, length_m, GridExtent(SIDE, SIDE), covariance)


def distance_to(tracks: list[Floats], points: Floats) -> Floats:
    """Return the distance of each point to the nearest of the tracks."""
    nearest = np.full(len(points), np.inf)
    for track in tracks:
        for a, b in zip(track, track[1:], strict=False):
            leg = b - a
            part = np.clip((points - a) @ leg / max(float(leg @ leg), 1e-12), 0.0, 1.0)
            nearest = np.minimum(nearest, np.hypot(*(points - a - part[:, None] * leg).T))
    return nearest


@pytest.mark.parametrize("drones", [1, 2, 3, 5])
@pytest.mark.parametrize("name", ["expanding_square", "spiral"])
def test_squares_and_spirals_leave_no_gap_around_the_datum(name: str, drones: int) -> None:
    tracks = LAYOUTS[name](layout_of(drones))
    # As much as all drones can search, but for the last ring.
    reach = math.sqrt(drones * 15000 * SPACING / math.pi) - 2.5 * drones * SPACING
    side = np.linspace(-max(reach, 200), max(reach, 200), 60)
    points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    points = points[np.hypot(*points.T) <= max(reach, 200)]
    corner = math.sqrt(2) if name == "expanding_square" else 1.1
    assert distance_to(tracks, points).max() <= corner * SPACING / 2 + 1e-6


@pytest.mark.parametrize("creeping", [False, True])
@pytest.mark.parametrize("drones", [1, 3])
def test_lanes_are_one_spacing_apart_along_or_across_the_greatest_spread(
    drones: int, creeping: bool
) -> None:
    layout = layout_of(drones)
    tracks = LAYOUTS["creeping_line" if creeping else "sweep"](layout)
    axis = np.array([0.6, 0.8])
    lanes = np.concatenate([track.reshape(-1, 2, 2) for track in tracks])
    legs = lanes[:, 1] - lanes[:, 0]
    legs /= np.hypot(*legs.T)[:, None]
    assert np.abs(legs @ axis) == pytest.approx(0.0 if creeping else 1.0, abs=1e-9)
    across = (lanes.mean(axis=1) @ np.array([-legs[0, 1], legs[0, 0]])) / SPACING
    assert np.abs(np.diff(across)) == pytest.approx(1.0)
    assert across.sum() == pytest.approx(0.0, abs=1e-6)
    # The sides are in the ratio of the spreads, and the area is what the drones can search.
    length, width = np.hypot(*(lanes[0, 1] - lanes[0, 0])), len(lanes) * SPACING
    assert length * width == pytest.approx(drones * 15000 * SPACING, rel=0.1)
    assert (width / length if creeping else length / width) == pytest.approx(2.0, rel=0.15)


@pytest.mark.parametrize("drones", [1, 2, 4])
def test_every_triangle_of_a_sector_search_passes_the_datum(drones: int) -> None:
    for track in LAYOUTS["sector"](layout_of(drones)):
        triangles = track.reshape(-1, 4, 2)
        assert triangles[:, [0, 3]] == pytest.approx(0.0, abs=1e-6)
        sides = np.hypot(*np.moveaxis(np.diff(triangles, axis=1), 2, 0))
        assert np.ptp(sides, axis=1) == pytest.approx(0.0, abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from(NAMES),
    st.integers(1, 5),
    st.tuples(st.floats(1000, 7000), st.floats(1000, 7000)),
    st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
    st.integers(0, 99),
)
def test_tracks_begin_at_the_drones_and_stay_on_the_grid(
    name: str, drones: int, place: tuple[float, float], drift: tuple[float, float], seed: int
) -> None:
    layout = layout_of(drones)
    datum = Datum(np.array(place), np.array(drift), layout.covariance)
    starts = np.random.default_rng(seed).uniform(0, SIDE, (drones, 2))
    tracks = tracks_of(name, datum, layout, starts, np.full(drones, CRUISE))
    assert len(tracks) == drones
    for start, track in zip(starts, tracks, strict=True):
        assert track[0] + datum.position == pytest.approx(start)
        # To where the drone is after the whole time, and the datum has drifted.
        assert along(track)[-1] >= 0.5 * layout.length_m or len(track) <= 2


@pytest.mark.parametrize("drones", [1, 3])
def test_drones_share_a_given_pattern_in_stretches_of_equal_length(drones: int) -> None:
    pattern = SearchPattern(pattern="PS", heading=30, track_spacing=100, length=1200, width=600)
    datum = Datum(np.full(2, 4000.0), np.zeros(2), np.eye(2))
    tracks = tracks_along(
        pattern, datum, layout_of(drones, 1.0), np.full((drones, 2), 4000.0),
        np.full(drones, CRUISE),
    )  # fmt: skip
    lengths = [along(track[1:])[-1] for track in tracks]
    assert lengths == pytest.approx([pattern.track.length_m / drones] * drones)
    exact = pattern.track.points_m * (1, -1)
    flown = np.concatenate([points_at(t[1:], np.linspace(0, along(t[1:])[-1], 50)) for t in tracks])
    assert distance_to([exact], flown) == pytest.approx(0.0, abs=1e-6)


def airframes_of(drones: int, radius: float = 0.0, acceleration: float = 0.0) -> NDArray[np.void]:
    slowest = 6.0 if radius else 0.0
    return np.array([(CRUISE, slowest, radius, acceleration)] * drones, AIRFRAMES)


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(NAMES),
    st.integers(1, 3),
    st.sampled_from([0.0, 2.5]),
    st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
    st.integers(0, 99),
)
def test_drones_that_can_hover_keep_to_their_tracks(
    name: str, drones: int, acceleration: float, wind: tuple[float, float],
    drift: tuple[float, float], seed: int,
) -> None:  # fmt: skip
    layout, airframes = layout_of(drones), airframes_of(drones, acceleration=acceleration)
    datum = Datum(np.full(2, 4000.0), np.array(drift), layout.covariance)
    flights = np.zeros(drones, MOTION_STATES)
    starts = np.random.default_rng(seed).uniform(3000, 5000, (drones, 2))
    flights["east"], flights["south"] = starts.T
    flights["speed"] = CRUISE
    air, tolerance = Wind(*wind, STEP_S), SPACING / 8
    tracks = tracks_of(name, datum, layout, starts, airframes["cruise"])
    follower = TrackGuidance(tracks, datum, airframes, air, GridExtent(SIDE, SIDE), tolerance)
    path = np.empty((pieces_of(airframes, STEP_S) + 1, 2))
    relative = np.empty((60, drones, len(path), 2))
    for step in range(60):
        actions = follower(flights, step)
        times = STEP_S * (step + np.linspace(0, 1, len(path)))
        for n in range(drones):
            fly(airframes, air, flights, n, actions[n], path)
            relative[step, n] = path - datum.at(times)
    # What is left of the first turn, and corners rounded at this acceleration.
    slack = 1.0 if acceleration == 0.0 else (CRUISE + 4) ** 2 / acceleration
    for n in range(drones):
        away = distance_to([tracks[n]], relative[:, n].reshape(-1, 2))
        assert away.max() <= tolerance + slack
    # A headwind of 4.2 m/s and corners leave at least this speed on average.
    ways = np.hypot(*np.moveaxis(np.diff(relative, axis=2), 3, 0)).sum(axis=(0, 2))
    assert (ways / (60 * STEP_S) >= 3.5).all()


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(NAMES),
    st.sampled_from([0.0, 60.0, 120.0]),
    st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    st.tuples(st.floats(0.1, 0.9), st.floats(0.1, 0.9)),
    st.integers(0, 99),
)
def test_no_drone_on_a_track_leaves_the_grid(
    name: str, radius: float, wind: tuple[float, float], place: tuple[float, float], seed: int
) -> None:
    side, airframes = 3000.0, airframes_of(2, radius)
    layout = layout_of(2)._replace(extent=GridExtent(side, side))
    datum = Datum(np.array(place) * side, np.array([0.5, -0.5]), layout.covariance)
    flights = np.zeros(2, MOTION_STATES)
    starts = np.random.default_rng(seed).uniform(0.3 * side, 0.7 * side, (2, 2))
    flights["east"], flights["south"] = starts.T
    flights["speed"] = CRUISE
    air = Wind(*wind, STEP_S)
    tracks = tracks_of(name, datum, layout, starts, airframes["cruise"])
    follower = TrackGuidance(tracks, datum, airframes, air, GridExtent(side, side), SPACING / 8)
    path = np.empty((pieces_of(airframes, STEP_S) + 1, 2))
    for step in range(60):
        actions = follower(flights, step)
        for n in range(2):
            most = min(CRUISE * STEP_S / radius, math.pi) if radius else math.pi
            assert abs(actions[n, 0]) <= most + 1e-9
            fly(airframes, air, flights, n, actions[n], path)
            assert path.min() >= 0.0
            assert path.max() <= side


@settings(max_examples=50, deadline=None)
@given(
    st.tuples(st.floats(-2000, 2000), st.floats(-2000, 2000)),
    st.floats(-4, 4),
    st.sampled_from([0.0, 40.0, 120.0]),
    st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
)
def test_a_drone_steers_to_its_goal(
    to: tuple[float, float], heading: float, radius: float, wind: tuple[float, float]
) -> None:
    airframes, flights = airframes_of(1, radius), np.zeros(1, MOTION_STATES)
    flights["east"] = flights["south"] = SIDE / 2
    flights["heading"], flights["speed"] = heading, CRUISE
    goal = np.array([to]) + SIDE / 2
    path = np.empty((pieces_of(airframes, STEP_S) + 1, 2))
    air, nearest = Wind(*wind, STEP_S), math.inf
    for _ in range(50):
        action = steer(airframes, air, GridExtent(SIDE, SIDE), flights, goal, False, path)
        fly(airframes, air, flights, 0, action[0], path)
        for a, b in zip(path, path[1:], strict=False):
            nearest = min(nearest, float(np.hypot(*(np.linspace(a, b, 20) - goal[0]).T).min()))
    assert nearest <= max(80.0, 2 * radius)


def test_greedy_goals_are_different_likely_cells_near_the_drones() -> None:
    probability = np.zeros((40, 40), np.float32)
    probability[5, 5], probability[5, 30], probability[30, 30] = 0.3, 0.3, 0.4
    flights = np.zeros(2, MOTION_STATES)
    flights["east"], flights["south"] = (700, 3800), (700, 700)
    goals = goals_on_map(probability, flights, 130.0, np.full(2, 130.0))
    assert goals.tolist() == [[5.5 * 130, 5.5 * 130], [30.5 * 130, 5.5 * 130]]
    nowhere = goals_on_map(np.zeros((40, 40), np.float32), flights, 130.0, np.full(2, 130.0))
    assert nowhere.tolist() == [[2600.0, 2600.0]] * 2

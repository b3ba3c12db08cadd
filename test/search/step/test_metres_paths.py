# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The paths of drones in metres, against their motion in small steps."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from numpy.typing import NDArray

from dsse_ros.search.step.metres_paths import (
    MOTION_STATES,
    SAGITTA_M,
    Wind,
    airframes_of,
    pieces_of,
    write_path,
)
from dsse_ros.world.searchers.searcher import Searcher

STEP_S = 13.0
FINE = 20_000
CALM = Wind(0.0, 0.0, STEP_S)


@njit
def fly_one(airframes: Any, wind: Any, states: Any, turn: float, speed: float, path: Any) -> None:
    write_path(airframes[0], wind, states[0], turn, speed, path)


def flown(
    kind: Searcher,
    turn: float,
    speed: float,
    *,
    start: tuple[float, float] = (0.3, 10.0),
    wind: Wind = CALM,
) -> tuple[NDArray[np.float64], NDArray[np.void]]:
    """Return the path and the state after a step from heading and speed `start`."""
    airframes, states = airframes_of([kind]), np.zeros(1, MOTION_STATES)
    states[0] = (500.0, 700.0, *start)
    path = np.zeros((pieces_of(airframes, STEP_S) + 1, 2))
    fly_one(airframes, wind, states, turn, speed, path)
    return path, states[0]


def plane(radius_m: float, acceleration: float | None = None) -> Searcher:
    return Searcher(doc="", speed=10.0, turn_radius=radius_m, acceleration=acceleration)


MULTICOPTER = Searcher(doc="", speed=10.0)


def test_without_a_turn_radius_a_drone_turns_on_the_spot_and_flies_straight() -> None:
    path, after = flown(MULTICOPTER, math.pi / 2 - 0.3, 10.0)
    assert path.tolist() == [[500.0, 700.0], [pytest.approx(630.0), pytest.approx(700.0)]]
    assert after["heading"] == pytest.approx(math.pi / 2) and after["speed"] == 10.0


@settings(max_examples=100, deadline=None)
@given(
    st.floats(20, 500), st.floats(-math.pi, math.pi), st.floats(4, 10), st.floats(4, 10),
    st.floats(0.3, 5) | st.none(), st.floats(-6, 6),
)  # fmt: skip
def test_an_arc_is_never_tighter_than_the_turn_radius_and_its_pieces_lie_on_it(
    radius_m: float, turn: float, first: float, speed: float, acceleration: float | None,
    heading: float,
) -> None:  # fmt: skip
    kind = plane(radius_m, acceleration)
    path, after = flown(kind, turn, speed, start=(heading, first))
    # The same motion in small steps: heading by the speed over the radius until it has turned.
    t = np.linspace(0.0, STEP_S, FINE + 1)
    ramp_s = abs(speed - first) / acceleration if acceleration else 0.0
    along = np.where(t < ramp_s, first + np.sign(speed - first) * (acceleration or 0.0) * t, speed)
    lengths = np.concatenate([[0.0], np.cumsum((along[1:] + along[:-1]) / 2 * np.diff(t))])
    turned = np.minimum(lengths / radius_m, abs(turn)) * np.sign(turn)
    middle = heading + (turned[1:] + turned[:-1]) / 2
    pieces = np.diff(lengths)[:, None] * np.stack([np.sin(middle), -np.cos(middle)], axis=1)
    fine = np.concatenate([[[500.0, 700.0]], [500.0, 700.0] + np.cumsum(pieces, axis=0)])
    at = np.linspace(0, FINE, len(path)).round().astype(int)
    # Points fall between two small steps.
    assert np.abs(path - fine[at]).max() < 0.02
    assert after["heading"] == pytest.approx(heading + turned[-1], abs=1e-3)
    assert after["speed"] == pytest.approx(along[-1], abs=1e-3)
    for k, (first_at, last_at) in enumerate(itertools.pairwise(at)):
        one, other = path[k], path[k + 1]
        away = fine[first_at : last_at + 1] - one
        chord = other - one
        aside = np.abs(away @ [chord[1], -chord[0]]) / max(np.hypot(*chord), 1e-9)
        assert aside.max() < SAGITTA_M + 0.05


@settings(max_examples=100, deadline=None)
@given(
    st.floats(-math.pi, math.pi), st.floats(0, 10), st.floats(0, 10), st.floats(0.3, 5),
    st.floats(-6, 6),
)  # fmt: skip
def test_a_corner_takes_the_time_that_the_acceleration_allows(
    turn: float, first: float, speed: float, acceleration: float, heading: float
) -> None:
    kind = Searcher(doc="", speed=10.0, acceleration=acceleration)
    path, after = flown(kind, turn, speed, start=(heading, first))
    before = first * np.array([math.sin(heading), -math.cos(heading)])
    wanted = speed * np.array([math.sin(heading + turn), -math.cos(heading + turn)])
    change = float(np.hypot(*(wanted - before)))
    t = np.linspace(0.0, STEP_S, FINE + 1)[:, None]
    share = np.minimum(t * acceleration / change, 1.0) if change > 0.0 else np.ones_like(t)
    velocity = before + share * (wanted - before)
    moved = np.cumsum((velocity[1:] + velocity[:-1]) / 2 * STEP_S / FINE, axis=0)
    at = np.linspace(0, FINE, len(path)).round().astype(int)[1:] - 1
    assert np.abs(path[1:] - [500.0, 700.0] - moved[at]).max() < 0.02
    ends = after["speed"] * np.array([math.sin(after["heading"]), -math.cos(after["heading"])])
    assert ends.tolist() == pytest.approx(velocity[-1].tolist(), abs=1e-2)


@settings(max_examples=50, deadline=None)
@given(st.sampled_from([0.0, 80.0]), st.floats(-2, 2), st.floats(-9, 9), st.floats(-9, 9))
def test_wind_adds_to_the_airspeed(radius_m: float, turn: float, east: float, south: float) -> None:
    calm, after = flown(plane(radius_m), turn, 10.0)
    windy, also = flown(plane(radius_m), turn, 10.0, wind=Wind(east, south, STEP_S))
    t = np.linspace(0.0, STEP_S, len(calm))[:, None]
    assert np.abs(windy - calm - t * [east, south]).max() < 1e-9
    assert also["heading"] == after["heading"] and also["speed"] == after["speed"]

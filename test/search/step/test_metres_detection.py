# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Lateral range laws on paths, against small steps and against the formulas of search theory."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numba import njit
from numpy.typing import NDArray

from dsse_ros.search.step.metres_detection import detectors_of, missed
from dsse_ros.world.sensors.lateral_range import LateralRange
from dsse_ros.world.sensors.search_theory import inverse_cube_pod

STEP_S, SPEED = 13.0, 10.0
STRIP = LateralRange(reach_m=65.0, pod=0.8)
CUBE = LateralRange(sweep_width_m=100.0, speed_mps=SPEED)


@njit
def missed_by(
    detectors: Any, path: Any, looked: Any, step_s: float, person: Any, multiplier: float
) -> float:
    return float(missed(detectors[0], path, looked, step_s, person, multiplier))


def miss(
    law: LateralRange, path: NDArray[np.float64], person: tuple[float, ...], *,
    multiplier: float = 1.0, looked: list[bool] | None = None, step_s: float = STEP_S,
) -> float:  # fmt: skip
    flags = np.array([True] * len(path) if looked is None else looked)
    return missed_by(detectors_of([law], step_s), path, flags, step_s, person, multiplier)


def distances(
    path: NDArray[np.float64], person: tuple[float, ...], count: int
) -> NDArray[np.float64]:
    """Return the distance of the person from the drone at `count` equal times of the step."""
    t = np.linspace(0.0, 1.0, count)
    at = np.linspace(0.0, 1.0, len(path))
    x = person[0] + t * (person[2] - person[0]) - np.interp(t, at, path[:, 0])
    y = person[1] + t * (person[3] - person[1]) - np.interp(t, at, path[:, 1])
    return np.hypot(x, y)


place = st.floats(-200, 200)
paths = st.lists(st.tuples(place, place), min_size=2, max_size=6).map(np.array)
persons = st.tuples(place, place, place, place)


looks = st.lists(st.booleans(), min_size=6, max_size=6) | st.just([True] * 6)


def looking(path: NDArray[np.float64], looked: list[bool], count: int) -> NDArray[np.bool_]:
    """Return whether the drone looks at `count` equal times of the step."""
    pieces = len(path) - 1
    piece = np.minimum((np.linspace(0.0, 1.0, count) * pieces).astype(int), pieces - 1)
    return np.array(looked)[piece + 1]


@settings(max_examples=300, deadline=None)
@given(paths, persons, looks)
def test_definite_range_detects_once_per_pass_while_the_drone_looks(
    path: NDArray[np.float64], person: tuple[float, ...], looked: list[bool]
) -> None:
    # A tenth of a second of the step would not see a graze.
    away = distances(path, person, 13 * 10 * 100 + 1)
    turning = np.concatenate([away[[0, -1]], away[1:-1][np.diff(np.sign(np.diff(away))) != 0]])
    assume(np.abs(turning - STRIP.reach_m).min() > 0.1)
    inside, looked = away <= STRIP.reach_m, looked[: len(path)]
    sees = inside & looking(path, looked, len(away))
    before = np.concatenate([[looked[0] and inside[0]], sees[:-1]])
    passes = int((sees & ~before).sum())
    assert miss(STRIP, path, person, looked=looked) == pytest.approx((1 - 0.8) ** passes)
    assert miss(STRIP, path, person, looked=looked, multiplier=0.5) == pytest.approx(0.6**passes)


@settings(max_examples=100, deadline=None)
@given(paths, persons, looks)
def test_the_inverse_cube_law_adds_up_what_each_moment_sees(
    path: NDArray[np.float64], person: tuple[float, ...], looked: list[bool]
) -> None:
    away = distances(path, person, 200_001)
    assume(away.min() > 2.0)
    rate = CUBE.sweep_width_m**2 * SPEED / (8 * math.pi) / away**3
    rate *= looking(path, looked, len(away))
    exposure = float(((rate[1:] + rate[:-1]) / 2).mean() * STEP_S)
    seen = miss(CUBE, path, person, looked=looked[: len(path)])
    assert -math.log(seen) == pytest.approx(exposure, rel=1e-3, abs=1e-4)


@settings(max_examples=50, deadline=None)
@given(st.floats(5, 300))
def test_a_long_straight_track_has_the_lateral_range_curve_of_the_law(x: float) -> None:
    path = np.array([[-1e6, 0.0], [1e6, 0.0]])
    law = math.exp(-(CUBE.sweep_width_m**2) / (4 * math.pi * x**2))
    assert miss(CUBE, path, (0.0, x, 0.0, x), step_s=2e6 / SPEED) == pytest.approx(law, rel=1e-6)


@pytest.mark.parametrize("coverage", [0.5, 1.0, 1.5])
def test_parallel_tracks_have_the_pod_of_their_coverage(coverage: float) -> None:
    spacing = CUBE.sweep_width_m / coverage
    away = (np.arange(2000) + 0.5) / 2000 * spacing
    share = np.ones(len(away))
    for track in range(-60, 61):
        path = np.array([[-1e5, track * spacing], [1e5, track * spacing]])
        share *= [miss(CUBE, path, (0.0, x, 0.0, x), step_s=2e5 / SPEED) for x in away]
    assert 1.0 - share.mean() == pytest.approx(inverse_cube_pod(coverage), abs=0.01)

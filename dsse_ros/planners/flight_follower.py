# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drones that fly tracks about a drifting datum, step by step."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.flight_patterns import Datum
from dsse_ros.planners.planner import DrawsNothing
from dsse_ros.step.flight_paths import Wind, pieces_of
from dsse_ros.step.flight_steering import steer
from dsse_ros.step.polylines import points_at

Floats = NDArray[np.float64]

SAMPLES = 64
"""Points of a track that a drone may fly to in a step, among which it chooses."""
HALVINGS = 10
"""Halvings of the way between the farthest point within reach and the next one."""


class TrackFollower(DrawsNothing):
    """Flies each drone along its own track.

    A drone that can hover flies straight to the farthest point of its track that it reaches in the
    step, such that it is never farther than the tolerance from its track; it slows down for sharp
    corners. One that cannot flies towards the point that is a step ahead, and turns as tightly as
    it can.

    Args:
        tracks: (K, 2) float64 each, relative to the datum, see `flight_patterns.tracks_of`.
        datum: The datum.
        flyers: (N,) of `FLYERS`, of each drone.
        wind: The wind, and the time of a step.
        side_m: Side of the grid.
        tolerance_m: Greatest distance from a track.
    """

    def __init__(
        self,
        tracks: Sequence[Floats],
        datum: Datum,
        flyers: NDArray[np.void],
        wind: Wind,
        side_m: float,
        tolerance_m: float,
    ) -> None:
        self._tracks, self._datum, self._flyers = tracks, datum, flyers
        self._wind, self._side, self._tolerance = wind, side_m, tolerance_m
        self._flown = np.zeros(len(tracks))
        self._goals = np.zeros(len(tracks))
        self._path = np.empty((pieces_of(flyers, wind.step_s) + 1, 2))

    def __call__(
        self, flights: NDArray[np.void], step: int, drones: NDArray[np.int64] | None = None
    ) -> Floats:
        """Return the turn and the airspeed of each drone, (D, 2) float64, in radians and m/s.

        Args:
            flights: (D,) of `FLIGHTS`.
            step: Number of steps done.
            drones: (D,) int64, their numbers; None for all.
        """
        numbers = np.arange(len(self._tracks)) if drones is None else drones
        now_s = step * self._wind.step_s
        positions = np.stack([flights["east"], flights["south"]], axis=1)
        relative = positions - self._datum.at(now_s)
        flown, goals = self._flown.copy(), self._goals.copy()
        points = np.empty((len(flights), 2))
        for k, n in enumerate(numbers.tolist()):
            flown[n] = self._progress(n, relative[k])
            goals[n], points[k] = self._goal(n, relative[k], flown[n])
        self._flown, self._goals = flown, goals
        goal = points + self._datum.at(now_s + self._wind.step_s)
        return steer(self._flyers[numbers], self._wind, self._side, flights, goal, True, self._path)

    def _progress(self, n: int, position: Floats) -> float:
        """Return the length of the track to the point next to a drone, up to its last goal."""
        lengths = np.linspace(self._goals[n], self._flown[n], SAMPLES + 1)
        away = np.hypot(*(points_at(self._tracks[n], lengths) - position).T)
        return float(lengths[np.argmin(away)])

    def _goal(self, n: int, position: Floats, flown: float) -> tuple[float, Floats]:
        """Return where on its track a drone flies to in the step, as a length and a point."""
        flyer, step_s = self._flyers[n], self._wind.step_s
        carried = (np.array([self._wind.east, self._wind.south]) - self._datum.drift) * step_s
        reach = float(flyer["cruise"]) * step_s

        def within_reach(point: Floats) -> NDArray[np.bool_]:
            return np.hypot(*(point - position - carried).T) <= reach

        lengths = flown + (reach + math.hypot(*carried)) * np.arange(SAMPLES + 1) / SAMPLES
        points = points_at(self._tracks[n], lengths)
        allowed = within_reach(points)
        if flyer["slowest"] <= 0.0:
            allowed &= _deviations(position, points) <= self._tolerance
        allowed[0] = True
        last = int(np.argmin(allowed)) - 1 if not allowed.all() else SAMPLES
        low = float(lengths[last])
        if last < SAMPLES and not within_reach(points[last + 1]):
            high = float(lengths[last + 1])
            for _ in range(HALVINGS):
                middle = (low + high) / 2
                if within_reach(points_at(self._tracks[n], np.array(middle))):
                    low = middle
                else:
                    high = middle
        return low, points_at(self._tracks[n], np.array(low))


def _deviations(start: Floats, points: Floats) -> Floats:
    """Return how far a track leads from the straight line to each of its points, (S,).

    Args:
        start: (2,) float64, where the lines begin.
        points: (S, 2) float64, points of the track.
    """
    lines = points - start
    squared = np.maximum((lines**2).sum(axis=1), 1e-12)
    away = points[None] - start
    share = np.clip((away * lines[:, None]).sum(axis=2) / squared[:, None], 0.0, 1.0)
    distance = np.hypot(*np.moveaxis(away - share[..., None] * lines[:, None], 2, 0))
    before = np.tri(len(points), dtype=bool)
    return np.where(before, distance, 0.0).max(axis=1)

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
from dsse_ros.step.polylines import SAMPLES, along, goal_within_reach, nearest, points_at

Floats = NDArray[np.float64]


class TrackFollower(DrawsNothing):
    """Flies each drone along its own track, see `polylines`.

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
        wind, step_s = self._wind, self._wind.step_s
        carried = (np.array([wind.east, wind.south]) - self._datum.drift) * step_s
        for k, n in enumerate(numbers.tolist()):
            track, flyer = self._tracks[n], self._flyers[n]
            passed = np.linspace(goals[n], flown[n], SAMPLES + 1)
            flown[n] = nearest(track, relative[k], passed)
            goals[n], points[k] = goal_within_reach(
                track, relative[k], flown[n], float(flyer["cruise"]) * step_s, carried,
                math.inf if flyer["slowest"] > 0.0 else self._tolerance,
            )  # fmt: skip
        self._flown, self._goals = flown, goals
        goal = points + self._datum.at(now_s + self._wind.step_s)
        return steer(self._flyers[numbers], self._wind, self._side, flights, goal, True, self._path)

    def ahead(self, step: int, steps: int) -> list[Floats]:
        """Return where each drone will be, in turn: what is left of its track, at cruise.

        Args:
            step: Number of steps done.
            steps: Steps left.

        Returns:
            (M, 2) float64 each, metres to the east and to the south of the grid's north-west
            corner: where the step ends, and the corners of the track until the steps are over,
            with the datum where it will have drifted by then.
        """
        found = []
        for track, done, flyer in zip(self._tracks, self._goals, self._flyers, strict=True):
            lengths, cruise = along(track), float(flyer["cruise"])
            end = min(done + cruise * (steps - 1) * self._wind.step_s, lengths[-1])
            to_come = np.array([done, *lengths[(lengths > done) & (lengths < end)], end])
            times_s = (step + 1) * self._wind.step_s + (to_come - done) / cruise
            found.append(points_at(track, to_come) + self._datum.at(times_s))
        return found

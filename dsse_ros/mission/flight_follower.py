# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drones that fly along commanded tracks in metres, step by step, without ROS.

A drone that turns on the spot flies straight to the farthest point of its track that it reaches in
the step without leaving the track by more than `TOLERANCE_M`. One with a turn radius flies towards
the point of its track that is a step ahead, on its tightest arc and then straight on. Both fly at
the lower of their cruise and the airspeed that brings them there in time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsse_ros.step.flight_paths import Wind, shares_of
from dsse_ros.step.flight_steering import tangent_turn
from dsse_ros.step.polylines import along, points_at

Floats = NDArray[np.float64]

TOLERANCE_M = 10.0
"""Largest distance from a track, and from its end for a drone that has arrived there; for an end
not less than the turn radius."""
_SAMPLES = 64
"""Points of the part of a track that is within reach, from which the next one is chosen."""


@dataclass(frozen=True, eq=False)
class Track:
    """What is left of a track.

    Attributes:
        points: (M, 2) float64, metres to the east and to the south of the grid's north-west
            corner. The first one is where the drone was on it.
    """

    points: Floats

    def after(self, path: Floats) -> Track:
        """Return what is left after a path (K + 1, 2) was flown: from the point next to its end.

        A track that crosses itself is left only up to a path's length ahead.
        """
        flown = float(np.hypot(*np.diff(path, axis=0).T).sum())
        lengths = along(self.points)
        ahead = np.linspace(0.0, min(1.5 * flown, lengths[-1]), _SAMPLES + 1)
        away = np.hypot(*(points_at(self.points, ahead) - path[-1]).T)
        # The farthest one of those that are as near.
        done = float(ahead[len(ahead) - 1 - int(np.argmin(away[::-1]))])
        left = self.points[lengths > done]
        return replace(self, points=np.vstack([points_at(self.points, np.array([done])), left]))


def has_arrived(track: Track, path: Floats, radius_m: float) -> bool:
    """Return whether a path (K + 1, 2) comes to the end of a track.

    A track that leads past its end before is not over.

    Args:
        track: The track, after the path.
        path: The path.
        radius_m: Radius of the drone's tightest turn.
    """
    near = max(TOLERANCE_M, radius_m)
    starts, legs = path[:-1], np.diff(path, axis=0)
    squared = np.maximum((legs**2).sum(axis=1), 1e-12)
    share = np.clip(((track.points[-1] - starts) * legs).sum(axis=1) / squared, 0.0, 1.0)
    away = np.hypot(*(starts + share[:, None] * legs - track.points[-1]).T).min()
    return bool(away <= near and along(track.points)[-1] <= 2.0 * near)


def steer(track: Track, flight: np.void, flyer: np.record, wind: Wind) -> tuple[float, float]:
    """Return the turn and the speed, -1 to 1, that fly a step along a track.

    Args:
        track: What is left of it.
        flight: The drone, one of `flight_paths.FLIGHTS`.
        flyer: Its kind, one of `flight_paths.FLYERS`.
        wind: The wind, and the time of a step.
    """
    here = np.array([flight["east"], flight["south"]])
    carried = np.array([wind.east, wind.south]) * wind.step_s
    reach = float(flyer.cruise) * wind.step_s
    goal = _goal(track.points, here, carried, reach, straight=flyer.radius <= 0.0)
    east, south = (goal - here - carried).tolist()
    heading, cruise = float(flight["heading"]), float(flyer.cruise)
    if flyer.radius > 0.0:
        way = 1.0 if east * math.cos(heading) + south * math.sin(heading) >= 0.0 else -1.0
        turn = way * tangent_turn(float(flyer.radius), heading, east, south, way)
    else:
        turn = math.remainder(math.atan2(east, -south) - heading, 2 * math.pi)
    speed = min(max(math.hypot(east, south) / wind.step_s, float(flyer.slowest)), cruise)
    return shares_of(flyer, turn, speed, wind.step_s)


def _goal(points: Floats, here: Floats, carried: Floats, reach: float, *, straight: bool) -> Floats:
    """Return the point of a track to fly to in a step."""
    lengths = along(points)
    ahead = np.linspace(0.0, min(reach + math.hypot(*carried), lengths[-1]), _SAMPLES + 1)
    goals = points_at(points, ahead)
    good = np.hypot(*(goals - here - carried).T) <= reach
    if straight:
        corners = points[1:-1]
        for k, goal in enumerate(goals):
            passed = corners[lengths[1:-1] < ahead[k]]
            good[k] &= not len(passed) or _away(passed, here, goal) <= TOLERANCE_M
    # The farthest; if none is good, the nearest of those farther than a step.
    return goals[np.flatnonzero(good)[-1]] if good.any() else goals[0]


def _away(points: Floats, start: Floats, end: Floats) -> float:
    """Return the largest distance of points (M, 2) from a leg."""
    leg = end - start
    squared = max(float(leg @ leg), 1e-12)
    share = np.clip((points - start) @ leg / squared, 0.0, 1.0)
    return float(np.hypot(*(start + share[:, None] * leg - points).T).max())

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

from dsse_ros.step.flight_paths import Wind

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
        lengths = _lengths(self.points)
        ahead = np.linspace(0.0, min(1.5 * flown, lengths[-1]), _SAMPLES + 1)
        away = np.hypot(*(_points_at(self.points, ahead) - path[-1]).T)
        # The farthest one of those that are as near.
        done = float(ahead[len(ahead) - 1 - int(np.argmin(away[::-1]))])
        left = self.points[lengths > done]
        return replace(self, points=np.vstack([_points_at(self.points, np.array([done])), left]))


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
    return bool(away <= near and _lengths(track.points)[-1] <= 2.0 * near)


def steer(
    track: Track, flight: np.void, flyer: np.record, wind: Wind, largest_turn: float
) -> tuple[float, float]:
    """Return the turn and the speed, -1 to 1, that fly a step along a track.

    Args:
        track: What is left of it.
        flight: The drone, one of `flight_paths.FLIGHTS`.
        flyer: Its kind, one of `flight_paths.FLYERS`.
        wind: The wind, and the time of a step.
        largest_turn: Largest turn of a step at cruise, radians.
    """
    here = np.array([flight["east"], flight["south"]])
    carried = np.array([wind.east, wind.south]) * wind.step_s
    reach = float(flyer.cruise) * wind.step_s
    goal = _goal(track.points, here, carried, reach, straight=flyer.radius <= 0.0)
    east, south = goal - here - carried
    heading, lowest = float(flight["heading"]), float(flyer.slowest)
    if flyer.radius > 0.0:
        turn = _tangent_turn(east, south, heading, float(flyer.radius))
    else:
        turn = math.remainder(math.atan2(east, -south) - heading, 2 * math.pi)
    speed = min(max(math.hypot(east, south) / wind.step_s, lowest), float(flyer.cruise))
    most = largest_turn * (speed / float(flyer.cruise) if flyer.radius > 0.0 else 1.0)
    share = 2 * (speed - lowest) / (flyer.cruise - lowest) - 1 if flyer.cruise > lowest else 1.0
    return min(max(turn / most, -1.0), 1.0) if most > 0.0 else 0.0, float(share)


def _goal(points: Floats, here: Floats, carried: Floats, reach: float, *, straight: bool) -> Floats:
    """Return the point of a track to fly to in a step."""
    lengths = _lengths(points)
    ahead = np.linspace(0.0, min(reach + math.hypot(*carried), lengths[-1]), _SAMPLES + 1)
    goals = _points_at(points, ahead)
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


def _tangent_turn(east: float, south: float, heading: float, radius: float) -> float:
    """Return the turn, to the right, on the tightest arc that ends in the direction of a point."""
    sin, cos = math.sin(heading), math.cos(heading)
    ahead, right = east * sin - south * cos, east * cos + south * sin
    side = 1.0 if right >= 0.0 else -1.0
    inwards = radius - side * right
    distance = math.hypot(ahead, inwards)
    if distance < radius:
        # No turn leads there before the drone has gained distance.
        return 0.0
    turn = math.atan2(ahead, inwards) - math.acos(radius / distance)
    return side * (turn % (2 * math.pi))


def _lengths(points: Floats) -> Floats:
    """Return how far each point of a track is along it, (M,)."""
    legs = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate([[0.0], legs.cumsum()])


def _points_at(points: Floats, lengths: Floats) -> Floats:
    """Return the points at these lengths of a track, (Q, 2)."""
    along = _lengths(points)
    return np.stack([np.interp(lengths, along, points[:, axis]) for axis in range(2)], axis=1)

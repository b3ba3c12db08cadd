# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drones that fly along commanded tracks in metres, step by step, without ROS."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.step.metres_paths import Wind, shares_of
from dsse_ros.search.step.metres_steering import tangent_turn
from dsse_ros.search.step.polylines import SAMPLES, along, goal_within_reach, nearest, points_at

Floats = NDArray[np.float64]

TOLERANCE_M = 10.0
"""Largest distance from a track, and from its end for a drone that has arrived there; for an end
not less than the turn radius."""


@dataclass(frozen=True, eq=False)
class TrackLeft:
    """What is left of a track.

    Attributes:
        points: (M, 2) float64, metres to the east and to the south of the grid's north-west
            corner. The first one is where the drone was on it.
    """

    points: Floats

    def after(self, path: Floats) -> TrackLeft:
        """Return what is left after a path (K + 1, 2) was flown: from the point next to its end.

        A track that crosses itself is left only up to a path's length ahead.
        """
        flown, lengths = float(along(path)[-1]), along(self.points)
        # The farthest one of those that are as near.
        ahead = np.linspace(min(1.5 * flown, float(lengths[-1])), 0.0, SAMPLES + 1)
        done = nearest(self.points, path[-1], ahead)
        left = self.points[lengths > done]
        return replace(self, points=np.vstack([points_at(self.points, np.array([done])), left]))


def has_arrived(track: TrackLeft, path: Floats, radius_m: float) -> bool:
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


def way_left(
    track: TrackLeft, flight: np.void, airframe: np.record, wind: Wind
) -> tuple[float, float]:
    """Return the length of the way to the end of a track, and the time that it takes at cruise.

    Args:
        track: What is left of the track.
        flight: The drone, one of `metres_paths.MOTION_STATES`.
        airframe: Its kind, one of `metres_paths.AIRFRAMES`.
        wind: The wind, which is slower than the kind's cruise.
    """
    here, ahead = [[flight["east"], flight["south"]]], track.points[1:]
    legs = np.diff(np.vstack([here, ahead if len(ahead) else track.points]), axis=0)
    lengths = np.hypot(*legs.T)
    legs, lengths = legs[lengths > 0.0], lengths[lengths > 0.0]
    east, south = (legs / lengths[:, None]).T
    across = wind.east * south - wind.south * east
    speeds = (
        wind.east * east + wind.south * south + np.sqrt(float(airframe.cruise) ** 2 - across**2)
    )
    return float(lengths.sum()), float((lengths / speeds).sum())


def steer(
    track: TrackLeft, flight: np.void, airframe: np.record, wind: Wind
) -> tuple[float, float]:
    """Return the turn and the speed, -1 to 1, that fly a step along a track, see `polylines`.

    The drone flies at the lower of its cruise and the airspeed that brings it there in time.

    Args:
        track: What is left of it.
        flight: The drone, one of `metres_paths.MOTION_STATES`.
        airframe: Its kind, one of `metres_paths.AIRFRAMES`.
        wind: The wind, and the time of a step.
    """
    here, heading = np.array([flight["east"], flight["south"]]), float(flight["heading"])
    carried, cruise = np.array([wind.east, wind.south]) * wind.step_s, float(airframe.cruise)
    tolerance = TOLERANCE_M if airframe.radius <= 0.0 else math.inf
    _, goal = goal_within_reach(track.points, here, 0.0, cruise * wind.step_s, carried, tolerance)
    east, south = (goal - here - carried).tolist()
    if airframe.radius > 0.0:
        way = 1.0 if east * math.cos(heading) + south * math.sin(heading) >= 0.0 else -1.0
        turn = way * tangent_turn(float(airframe.radius), heading, east, south, way)
    else:
        turn = math.remainder(math.atan2(east, -south) - heading, 2 * math.pi)
    speed = min(max(math.hypot(east, south) / wind.step_s, float(airframe.slowest)), cruise)
    return shares_of(airframe, turn, speed, wind.step_s)

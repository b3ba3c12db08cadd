# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The path of a drone in a step, in metres, compiled.

Positions are metres to the east and to the south of the grid's north-west corner. Headings are
radians clockwise from north. Heading and speed are those through the air: the wind carries the
whole path along. An action is a turn, -1 to 1 as a share of the largest turn of a step, and a
speed, -1 to 1 from the lowest to that of cruise.

A drone with a turn radius turns on an arc and flies straight on. One without changes its velocity
at its acceleration, along and across its path, or at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import inlined, kernel, part
from dsse_ros.base.compiled.records import dtype_of

Path: TypeAlias = NDArray[np.float64]  # (K + 1, 2), positions at equal times of a step, metres


class Airframe:
    """How a kind of drone flies."""

    cruise: float  # airspeed, m/s
    slowest: float  # lowest airspeed, m/s
    radius: float  # of the tightest turn, m; 0: any
    acceleration: float  # m/s^2; 0: at once


AIRFRAMES = dtype_of(Airframe)


class MotionState:
    """Where a drone is, and how it flies through the air."""

    east: float  # metres
    south: float
    heading: float  # radians clockwise from north
    speed: float  # m/s


MOTION_STATES = dtype_of(MotionState)

SAGITTA_M = 1.0
"""Distance of a path from the straight pieces that stand for it."""
MOST_PIECES = 16
_WITH_ACCELERATION = 4
"""Pieces of a path on which the velocity changes."""


class Wind(NamedTuple):
    """The velocity of the wind, m/s, to the east and to the south, and the time of a step, s."""

    east: float
    south: float
    step_s: float


def airframes_of(kinds: Iterable[Any]) -> NDArray[np.void]:
    """Return how each kind of drone, a `Searcher`, flies, (K,) of `AIRFRAMES`."""
    return np.array(
        [
            (kind.speed, kind.min_speed, kind.turn_radius, kind.acceleration or 0.0)
            for kind in kinds
        ],
        AIRFRAMES,
    )


def pieces_of(airframes: NDArray[np.void], step_s: float) -> int:
    """Return the number of straight pieces that stand for the path of a step."""
    most = 1
    for airframe in airframes:
        if airframe["radius"] > 0.0:
            # Pieces take equal times, on the arc and after it.
            arc = airframe["cruise"] * step_s / airframe["radius"]
            of_piece = 2 * math.acos(max(1.0 - SAGITTA_M / airframe["radius"], -1.0))
            most = max(most, min(math.ceil(arc / of_piece), MOST_PIECES))
        if airframe["acceleration"] > 0.0:
            most = max(most, _WITH_ACCELERATION)
    return most


def shares_of(airframe: np.void, turn: float, speed: float, step_s: float) -> tuple[float, float]:
    """Return the action of a turn in radians and an airspeed, see `metres_paths`."""
    span = float(airframe["cruise"] - airframe["slowest"])
    share = 2 * (speed - float(airframe["slowest"])) / span - 1 if span > 0.0 else 1.0
    largest = largest_turn(float(airframe["radius"]), speed, step_s)
    return min(max(turn / largest, -1.0), 1.0) if largest > 0.0 else 0.0, share


@inlined
def share_of(value: float) -> float:
    """Return an action's number within -1 and 1; one that is not finite is 0."""
    return min(max(value, -1.0), 1.0) if math.isfinite(value) else 0.0


@kernel
def largest_turn(radius: float, speed: float, step_s: float) -> float:
    """Return the largest turn of a step at a speed, in radians."""
    if radius <= 0.0:
        return math.pi
    return min(speed * step_s / radius, math.pi)


@part
def write_path(
    airframe: Airframe, wind: Wind, state: MotionState, turn: float, speed: float, path: Path
) -> None:
    """Fly a step: write its path and the state after it.

    Args:
        airframe: One of `AIRFRAMES`.
        wind: A `Wind`.
        state: One of `MOTION_STATES`, in and out.
        turn: To the right, in radians.
        speed: Airspeed at the end, m/s.
        path: (K + 1, 2) float64 out, positions at equal times, the first one the present.
    """
    if airframe.radius > 0.0:
        write_arc(airframe, wind, state, turn, speed, path)
    else:
        write_corner(airframe, wind, state, turn, speed, path)


@inlined
def write_arc(
    airframe: Airframe, wind: Wind, state: MotionState, turn: float, speed: float, path: Path
) -> None:
    """Write the path of a drone with a turn radius, and its state after it."""
    x, y, heading = state.east, state.south, state.heading
    radius, side = airframe.radius, 1.0 if turn >= 0.0 else -1.0
    change = speed - state.speed
    ramp_s = abs(change) / airframe.acceleration if airframe.acceleration > 0.0 else 0.0
    east, south = math.sin(heading), -math.cos(heading)
    center_x = x - side * radius * south
    center_y = y + side * radius * east
    pieces, before, arc_of_turn = len(path) - 1, 0.0, radius * abs(turn)
    # At a steady speed whole pieces of the arc are alike, and sines are dear.
    piece_s = wind.step_s / pieces
    piece_m = speed * piece_s if ramp_s == 0.0 else np.inf
    sin, cos = 0.0, 1.0
    if piece_m <= arc_of_turn:
        sin, cos = math.sin(side * piece_m / radius), math.cos(piece_m / radius)
    path[0, 0], path[0, 1] = x, y
    for k in range(1, pieces + 1):
        t = piece_s * k
        early = min(t, ramp_s)
        flown = speed * (t - early) + state.speed * early
        if early > 0.0:
            flown += change * early * early / (2.0 * ramp_s)
        arc = min(arc_of_turn, flown)
        if piece_m * k <= arc_of_turn:
            east, south = east * cos - south * sin, south * cos + east * sin
        elif arc != before:
            reached = heading + side * arc / radius
            east, south = math.sin(reached), -math.cos(reached)
        before = arc
        x = center_x + side * radius * south + (flown - arc) * east + wind.east * t
        y = center_y - side * radius * east + (flown - arc) * south + wind.south * t
        path[k, 0], path[k, 1] = x, y
    state.east, state.south, state.heading = x, y, heading + side * before / radius
    state.speed += change * (min(wind.step_s / ramp_s, 1.0) if ramp_s > 0.0 else 1.0)


@inlined
def write_corner(
    airframe: Airframe, wind: Wind, state: MotionState, turn: float, speed: float, path: Path
) -> None:
    """Write the path of a drone without a turn radius, and its state after it."""
    heading = state.heading + turn
    east, south = speed * math.sin(heading), -speed * math.cos(heading)
    from_east = from_south = change_x = change_y = ramp_s = 0.0
    if airframe.acceleration > 0.0:
        from_east = state.speed * math.sin(state.heading)
        from_south = -state.speed * math.cos(state.heading)
        change_x, change_y = east - from_east, south - from_south
        ramp_s = math.hypot(change_x, change_y) / airframe.acceleration
    from_x, from_y, pieces = state.east, state.south, len(path) - 1
    x, y = from_x, from_y
    path[0, 0], path[0, 1] = x, y
    for k in range(1, pieces + 1):
        t = wind.step_s * k / pieces
        early = min(t, ramp_s)
        x = from_x + from_east * early + east * (t - early) + wind.east * t
        y = from_y + from_south * early + south * (t - early) + wind.south * t
        if early > 0.0:
            x += change_x * early * early / (2.0 * ramp_s)
            y += change_y * early * early / (2.0 * ramp_s)
        path[k, 0], path[k, 1] = x, y
    if ramp_s > wind.step_s:
        share = wind.step_s / ramp_s
        east, south = from_east + share * change_x, from_south + share * change_y
        speed = math.hypot(east, south)
        heading = math.atan2(east, -south)
    state.east, state.south, state.heading, state.speed = x, y, heading, speed

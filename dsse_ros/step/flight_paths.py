# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.compiled.jit import inlined, kernel, part

FLYERS = np.dtype(
    [
        ("cruise", "f8"),  # airspeed, m/s
        ("slowest", "f8"),  # lowest airspeed, m/s
        ("radius", "f8"),  # of the tightest turn, m; 0: any
        ("acceleration", "f8"),  # m/s^2; 0: at once
    ],
    align=True,
)
FLIGHTS = np.dtype(
    [("east", "f8"), ("south", "f8"), ("heading", "f8"), ("speed", "f8")],
    align=True,
)
"""The state of a drone."""

SAGITTA_M = 1.0
"""Distance of a path from the straight pieces that stand for it."""
MOST_PIECES = 16
_WITH_ACCELERATION = 4
"""Pieces of a path whose velocity changes."""


class Wind(NamedTuple):
    """The velocity of the wind, m/s, to the east and to the south, and the time of a step, s."""

    east: float
    south: float
    step_s: float


def flyers_of(kinds: Iterable[Any]) -> NDArray[np.void]:
    """Return how each kind of drone, a `Searcher`, flies, (K,) of `FLYERS`."""
    return np.array(
        [
            (kind.speed, kind.min_speed, kind.turn_radius, kind.acceleration or 0.0)
            for kind in kinds
        ],
        FLYERS,
    )


def pieces_of(flyers: NDArray[np.void], step_s: float) -> int:
    """Return the number of straight pieces that stand for the path of a step."""
    most = 1
    for flyer in flyers:
        if flyer["radius"] > 0.0:
            # Pieces take equal times, on the arc and after it.
            arc = flyer["cruise"] * step_s / flyer["radius"]
            of_piece = 2 * math.acos(max(1.0 - SAGITTA_M / flyer["radius"], -1.0))
            most = max(most, min(math.ceil(arc / of_piece), MOST_PIECES))
        if flyer["acceleration"] > 0.0:
            most = max(most, _WITH_ACCELERATION)
    return most


def shares_of(flyer: np.void, turn: float, speed: float, step_s: float) -> tuple[float, float]:
    """Return the action of a turn in radians and an airspeed, see `flight_paths`."""
    span = float(flyer["cruise"] - flyer["slowest"])
    share = 2 * (speed - float(flyer["slowest"])) / span - 1 if span > 0.0 else 1.0
    largest = largest_turn(float(flyer["radius"]), speed, step_s)
    return min(max(turn / largest, -1.0), 1.0) if largest > 0.0 else 0.0, share


@inlined
def share_of(value):
    """Return an action's number within -1 and 1; one that is not finite is 0."""
    return min(max(value, -1.0), 1.0) if math.isfinite(value) else 0.0


@kernel
def largest_turn(radius, speed, step_s):
    """Return the largest turn of a step at a speed, in radians."""
    if radius <= 0.0:
        return math.pi
    return min(speed * step_s / radius, math.pi)


@part
def write_path(flyer, wind, flight, turn, speed, path):
    """Fly a step: write its path and the state after it.

    Args:
        flyer: One of `FLYERS`.
        wind: A `Wind`.
        flight: One of `FLIGHTS`, in and out.
        turn: To the right, in radians.
        speed: Airspeed at the end, m/s.
        path: (K + 1, 2) float64 out, positions at equal times, the first one the present.
    """
    if flyer.radius > 0.0:
        write_arc(flyer, wind, flight, turn, speed, path)
    else:
        write_corner(flyer, wind, flight, turn, speed, path)


@inlined
def write_arc(flyer, wind, flight, turn, speed, path):
    """Write the path of a drone with a turn radius, and its state after it."""
    x, y, heading = flight.east, flight.south, flight.heading
    radius, side = flyer.radius, 1.0 if turn >= 0.0 else -1.0
    change = speed - flight.speed
    ramp_s = abs(change) / flyer.acceleration if flyer.acceleration > 0.0 else 0.0
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
        flown = speed * (t - early) + flight.speed * early
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
    flight.east, flight.south, flight.heading = x, y, heading + side * before / radius
    flight.speed += change * (min(wind.step_s / ramp_s, 1.0) if ramp_s > 0.0 else 1.0)


@inlined
def write_corner(flyer, wind, flight, turn, speed, path):
    """Write the path of a drone without a turn radius, and its state after it."""
    heading = flight.heading + turn
    east, south = speed * math.sin(heading), -speed * math.cos(heading)
    from_east = from_south = change_x = change_y = ramp_s = 0.0
    if flyer.acceleration > 0.0:
        from_east = flight.speed * math.sin(flight.heading)
        from_south = -flight.speed * math.cos(flight.heading)
        change_x, change_y = east - from_east, south - from_south
        ramp_s = math.hypot(change_x, change_y) / flyer.acceleration
    from_x, from_y, pieces = flight.east, flight.south, len(path) - 1
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
    flight.east, flight.south, flight.heading, flight.speed = x, y, heading, speed

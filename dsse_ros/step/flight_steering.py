# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""Steering of drones in metres towards a position, without leaving the grid, compiled."""

from __future__ import annotations

import math

import numpy as np

from dsse_ros.compiled.jit import compiled, inlined, kernel, part
from dsse_ros.step.flight_paths import FLIGHTS, largest_turn, write_path

TRIED = 24
"""Turns that a drone tries to each side in order not to leave the grid."""
LEAST_ROOM_M = 5.0
"""Room that drones leave, see `room_after`."""
ROUND_POINTS = 8
"""Points of a turn whose distance to the edge is measured."""
CORRECTIONS = 3
"""Corrections of an airspeed and heading for the time that a change of velocity takes."""


@inlined
def copy_flight(flight, to):
    """Copy one of `FLIGHTS`."""
    to.east, to.south, to.heading, to.speed = (
        flight.east, flight.south, flight.heading, flight.speed
    )  # fmt: skip


@inlined
def to_edge(side, x, y):
    """Return how far a position is from the edge of the grid, negative beyond it."""
    return min(min(x, y), side - max(x, y))


@part
def room_after(flyer, wind, side, flight, path):
    """Return how much room a path leaves to stay on the grid; -inf if it leaves it.

    This is the distance to the edge of the way to the middle of the grid: while a drone with a turn
    radius turns there, or while one that changes its velocity stops.

    Args:
        flyer: One of `FLYERS`.
        wind: A `Wind`.
        side: Side of the grid.
        flight: One of `FLIGHTS`, after the path.
        path: (K + 1, 2) float64.
    """
    for k in range(1, len(path)):
        if to_edge(side, path[k, 0], path[k, 1]) < 0.0:
            return -np.inf
    room = to_edge(side, flight.east, flight.south)
    if flyer.radius > 0.0:
        drift = math.hypot(wind.east, wind.south) / flyer.cruise
        if room < 2 * flyer.radius * (1.0 + math.pi * drift) + LEAST_ROOM_M:
            right = room_of_turn(flyer, wind, side, flight, 1.0)
            room = min(room, max(right, room_of_turn(flyer, wind, side, flight, -1.0)))
    elif flyer.acceleration > 0.0:
        stop_s = flight.speed / flyer.acceleration
        east, south = math.sin(flight.heading), -math.cos(flight.heading)
        x = flight.east + stop_s * (flight.speed / 2 * east + wind.east)
        y = flight.south + stop_s * (flight.speed / 2 * south + wind.south)
        room = min(room, to_edge(side, x, y))
    else:
        room += LEAST_ROOM_M
    return room


@part
def room_of_turn(flyer, wind, side, flight, way):
    """Return the distance to the edge of a turn to the middle; -inf if it takes several steps.

    Args:
        flyer: One of `FLYERS`, with a radius.
        wind: A `Wind`.
        side: Side of the grid.
        flight: One of `FLIGHTS`.
        way: 1 to the right, -1 to the left.
    """
    radius, sin, cos = flyer.radius, math.sin(flight.heading), math.cos(flight.heading)
    turn = tangent_turn(
        radius, flight.heading, side / 2 - flight.east, side / 2 - flight.south, way
    )
    if turn > math.pi:
        return -np.inf
    x, y = flight.east + way * radius * cos, flight.south + way * radius * sin
    room = to_edge(side, flight.east, flight.south)
    for k in range(1, ROUND_POINTS + 1):
        angle = turn * k / ROUND_POINTS
        after, time_s = flight.heading + way * angle, radius * angle / flyer.cruise
        east = x - way * radius * math.cos(after) + wind.east * time_s
        south = y - way * radius * math.sin(after) + wind.south * time_s
        room = min(room, to_edge(side, east, south))
    return room


@inlined
def wrapped(angle):
    """Return an angle between -pi and pi."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


@kernel
def tangent_turn(radius, heading, east, south, way):
    """Return the turn, 0 to 2 pi, after which a drone flies straight to a position.

    Args:
        radius: Of the turn.
        heading: Of the drone.
        east: To the position, from the drone, in the air.
        south: The same.
        way: 1 to the right, -1 to the left.
    """
    sin, cos = math.sin(heading), math.cos(heading)
    ahead, inwards = east * sin - south * cos, radius - way * (east * cos + south * sin)
    distance = math.hypot(ahead, inwards)
    if distance < radius:
        # No turn leads there before the drone has gained distance.
        return 0.0
    return (math.atan2(ahead, inwards) - math.acos(radius / distance)) % (2 * math.pi)


@part
def aim(flyer, wind, flight, east, south, in_time):
    """Return the turn and the airspeed of a step towards a position.

    Args:
        flyer: One of `FLYERS`.
        wind: A `Wind`.
        flight: One of `FLIGHTS`.
        east: The position.
        south: The same.
        in_time: Whether the drone slows down to be there at the end of the step.
    """
    east -= flight.east + wind.east * wind.step_s
    south -= flight.south + wind.south * wind.step_s
    speed = flyer.cruise
    if flyer.radius > 0.0:
        right = east * math.cos(flight.heading) + south * math.sin(flight.heading)
        way = 1.0 if right >= 0.0 else -1.0
        turn = tangent_turn(flyer.radius, flight.heading, east, south, way)
        return way * min(turn, largest_turn(flyer.radius, speed, wind.step_s)), speed
    before_x = flight.speed * math.sin(flight.heading)
    before_y = -flight.speed * math.cos(flight.heading)
    x, y = east / wind.step_s, south / wind.step_s
    if flyer.acceleration > 0.0:
        for _ in range(CORRECTIONS):
            change_x, change_y = x - before_x, y - before_y
            ramp_s = min(math.hypot(change_x, change_y) / flyer.acceleration, wind.step_s)
            x = (east + change_x * ramp_s / 2) / wind.step_s
            y = (south + change_y * ramp_s / 2) / wind.step_s
    if in_time:
        speed = min(max(math.hypot(x, y), flyer.slowest), flyer.cruise)
    return wrapped(math.atan2(x, -y) - flight.heading), speed


@compiled()
def steer(flyers, wind, side, flights, goals, in_time, path):
    """Return the turn and the airspeed of each drone towards its goal, (N, 2) float64.

    A drone that would leave the grid turns less or more than it wants, or slows down. Near the edge
    it gains room, see `room_after`.

    Args:
        flyers: (N,) of `FLYERS`.
        wind: A `Wind`.
        side: Side of the grid.
        flights: (N,) of `FLIGHTS`.
        goals: (N, 2) float64, positions.
        in_time: See `aim`.
        path: (K + 1, 2) float64, scratch.
    """
    actions, flown = np.empty((len(flights), 2)), np.zeros(1, FLIGHTS)
    for n in range(len(flights)):
        flyer, flight = flyers[n], flights[n]
        turn, speed = aim(flyer, wind, flight, goals[n, 0], goals[n, 1], in_time)
        actions[n, 0], actions[n, 1] = turn, speed
        if room_of(flyer, wind, side, flight, actions[n], flown, path) < LEAST_ROOM_M:
            avoid(flyer, wind, side, flight, actions[n], flown, path)
    return actions


@part
def room_of(flyer, wind, side, flight, action, flown, path):
    """Return the room that a turn and an airspeed leave, see `room_after`."""
    copy_flight(flight, flown[0])
    write_path(flyer, wind, flown[0], action[0], action[1], path)
    return room_after(flyer, wind, side, flown[0], path)


@part
def avoid(flyer, wind, side, flight, action, flown, path):
    """Replace an action that leads off the grid by the nearest one that does not.

    If none leaves enough room, it is the one that leaves most; if all lead off the grid, a turn to
    its middle.
    """
    wanted, fast, most = action[0], action[1], largest_turn(flyer.radius, flyer.cruise, wind.step_s)
    best, turn_of_best, speed_of_best = -np.inf, 0.0, flyer.cruise
    for speed in (fast, flyer.cruise, flyer.slowest):
        for k in range(2 * TRIED + 1):
            turn = wanted + 2 * most / TRIED * ((k + 1) // 2) * (1 if k % 2 else -1)
            if flyer.radius > 0.0 and abs(turn) > most:
                continue
            action[0], action[1] = turn if flyer.radius > 0.0 else wrapped(turn), speed
            room = room_of(flyer, wind, side, flight, action, flown, path)
            if room >= LEAST_ROOM_M:
                return
            if room > best:
                best, turn_of_best, speed_of_best = room, action[0], speed
    action[0], action[1] = turn_of_best, speed_of_best
    if best == -np.inf:
        action[0], action[1] = aim(flyer, wind, flight, side / 2, side / 2, False)

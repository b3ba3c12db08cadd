# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Steering of drones in metres towards a position, without leaving the grid, compiled."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import compiled, inlined, kernel, part
from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.search.step.entities import Records
from dsse_ros.search.step.metres_paths import (
    MOTION_STATES,
    Airframe,
    MotionState,
    Path,
    Wind,
    largest_turn,
    write_path,
)

TRIED = 24
"""Turns that a drone tries to each side in order not to leave the grid."""
LEAST_ROOM_M = 5.0
"""Room that drones leave, see `room_after`."""
ROUND_POINTS = 8
"""Points of a turn at which the distance to the edge is measured."""
CORRECTIONS = 3
"""Corrections of an airspeed and heading for the time that a change of velocity takes."""


@inlined
def copy_state(state: MotionState, to: MotionState) -> None:
    """Copy a state."""
    to.east, to.south, to.heading, to.speed = (
        state.east, state.south, state.heading, state.speed
    )  # fmt: skip


@inlined
def to_edge(extent: GridExtent, x: float, y: float) -> float:
    """Return how far a position is from the edge of the grid, negative beyond it."""
    return min(min(x, y), min(extent.width - x, extent.height - y))


@part
def room_after(
    airframe: Airframe, wind: Wind, extent: GridExtent, state: MotionState, path: Path
) -> float:
    """Return how much room a path leaves to stay on the grid; -inf if it leaves it.

    This is the distance to the edge of the way to the middle of the grid: while a drone with a turn
    radius turns there, or while one that changes its velocity stops.

    Args:
        airframe: One of `AIRFRAMES`.
        wind: A `Wind`.
        extent: Of the grid.
        state: One of `MOTION_STATES`, after the path.
        path: (K + 1, 2) float64.
    """
    for k in range(1, len(path)):
        if to_edge(extent, path[k, 0], path[k, 1]) < 0.0:
            return -np.inf
    room = to_edge(extent, state.east, state.south)
    if airframe.radius > 0.0:
        drift = math.hypot(wind.east, wind.south) / airframe.cruise
        if room < 2 * airframe.radius * (1.0 + math.pi * drift) + LEAST_ROOM_M:
            right = room_of_turn(airframe, wind, extent, state, 1.0)
            room = min(room, max(right, room_of_turn(airframe, wind, extent, state, -1.0)))
    elif airframe.acceleration > 0.0:
        stop_s = state.speed / airframe.acceleration
        east, south = math.sin(state.heading), -math.cos(state.heading)
        x = state.east + stop_s * (state.speed / 2 * east + wind.east)
        y = state.south + stop_s * (state.speed / 2 * south + wind.south)
        room = min(room, to_edge(extent, x, y))
    else:
        room += LEAST_ROOM_M
    return room


@part
def room_of_turn(
    airframe: Airframe, wind: Wind, extent: GridExtent, state: MotionState, way: float
) -> float:
    """Return the distance to the edge of a turn to the middle; -inf if it takes several steps.

    Args:
        airframe: One of `AIRFRAMES`, with a radius.
        wind: A `Wind`.
        extent: Of the grid.
        state: One of `MOTION_STATES`.
        way: 1 to the right, -1 to the left.
    """
    radius, sin, cos = airframe.radius, math.sin(state.heading), math.cos(state.heading)
    east, south = extent.width / 2 - state.east, extent.height / 2 - state.south
    turn = tangent_turn(radius, state.heading, east, south, way)
    if turn > math.pi:
        return -np.inf
    x, y = state.east + way * radius * cos, state.south + way * radius * sin
    room = to_edge(extent, state.east, state.south)
    for k in range(1, ROUND_POINTS + 1):
        angle = turn * k / ROUND_POINTS
        after, time_s = state.heading + way * angle, radius * angle / airframe.cruise
        east = x - way * radius * math.cos(after) + wind.east * time_s
        south = y - way * radius * math.sin(after) + wind.south * time_s
        room = min(room, to_edge(extent, east, south))
    return room


@inlined
def wrapped(angle: float) -> float:
    """Return an angle between -pi and pi."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


@kernel
def tangent_turn(radius: float, heading: float, east: float, south: float, way: float) -> float:
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
def aim(
    airframe: Airframe, wind: Wind, state: MotionState, east: float, south: float, in_time: bool
) -> tuple[float, float]:
    """Return the turn and the airspeed of a step towards a position.

    Args:
        airframe: One of `AIRFRAMES`.
        wind: A `Wind`.
        state: One of `MOTION_STATES`.
        east: The position.
        south: The same.
        in_time: Whether the drone slows down to be there at the end of the step.
    """
    east -= state.east + wind.east * wind.step_s
    south -= state.south + wind.south * wind.step_s
    speed = airframe.cruise
    if airframe.radius > 0.0:
        right = east * math.cos(state.heading) + south * math.sin(state.heading)
        way = 1.0 if right >= 0.0 else -1.0
        turn = tangent_turn(airframe.radius, state.heading, east, south, way)
        return way * min(turn, largest_turn(airframe.radius, speed, wind.step_s)), speed
    before_x = state.speed * math.sin(state.heading)
    before_y = -state.speed * math.cos(state.heading)
    x, y = east / wind.step_s, south / wind.step_s
    if airframe.acceleration > 0.0:
        for _ in range(CORRECTIONS):
            change_x, change_y = x - before_x, y - before_y
            ramp_s = min(math.hypot(change_x, change_y) / airframe.acceleration, wind.step_s)
            x = (east + change_x * ramp_s / 2) / wind.step_s
            y = (south + change_y * ramp_s / 2) / wind.step_s
    if in_time:
        speed = min(max(math.hypot(x, y), airframe.slowest), airframe.cruise)
    return wrapped(math.atan2(x, -y) - state.heading), speed


@compiled()
def steer(
    airframes: Records,
    wind: Wind,
    extent: GridExtent,
    states: Records,
    goals: NDArray[np.float64],
    in_time: bool,
    path: Path,
) -> NDArray[np.float64]:
    """Return the turn and the airspeed of each drone towards its goal, (N, 2) float64.

    A drone that would leave the grid turns less or more than it wants, or slows down. Near the edge
    it gains room, see `room_after`.

    Args:
        airframes: (N,) of `AIRFRAMES`.
        wind: A `Wind`.
        extent: Of the grid.
        states: (N,) of `MOTION_STATES`.
        goals: (N, 2) float64, positions.
        in_time: See `aim`.
        path: (K + 1, 2) float64, scratch.
    """
    actions, flown = np.empty((len(states), 2)), np.zeros(1, MOTION_STATES)
    for n in range(len(states)):
        airframe, state = airframes[n], states[n]
        turn, speed = aim(airframe, wind, state, goals[n, 0], goals[n, 1], in_time)
        actions[n, 0], actions[n, 1] = turn, speed
        if room_of(airframe, wind, extent, state, actions[n], flown, path) < LEAST_ROOM_M:
            avoid(airframe, wind, extent, state, actions[n], flown, path)
    return actions


@part
def room_of(
    airframe: Airframe,
    wind: Wind,
    extent: GridExtent,
    state: MotionState,
    action: NDArray[np.float64],
    flown: Records,
    path: Path,
) -> float:
    """Return the room that a turn and an airspeed leave, see `room_after`."""
    copy_state(state, flown[0])
    write_path(airframe, wind, flown[0], action[0], action[1], path)
    return room_after(airframe, wind, extent, flown[0], path)


@part
def avoid(
    airframe: Airframe,
    wind: Wind,
    extent: GridExtent,
    state: MotionState,
    action: NDArray[np.float64],
    flown: Records,
    path: Path,
) -> None:
    """Replace an action that leads off the grid by the nearest one that does not.

    If none leaves enough room, it is the one that leaves most; if all lead off the grid, a turn to
    its middle.
    """
    wanted, fast, most = (
        action[0],
        action[1],
        largest_turn(airframe.radius, airframe.cruise, wind.step_s),
    )
    best, turn_of_best, speed_of_best = -np.inf, 0.0, airframe.cruise
    for speed in (fast, airframe.cruise, airframe.slowest):
        for k in range(2 * TRIED + 1):
            turn = wanted + 2 * most / TRIED * ((k + 1) // 2) * (1 if k % 2 else -1)
            if airframe.radius > 0.0 and abs(turn) > most:
                continue
            action[0], action[1] = turn if airframe.radius > 0.0 else wrapped(turn), speed
            room = room_of(airframe, wind, extent, state, action, flown, path)
            if room >= LEAST_ROOM_M:
                return
            if room > best:
                best, turn_of_best, speed_of_best = room, action[0], speed
    action[0], action[1] = turn_of_best, speed_of_best
    if best == -np.inf:
        action[0], action[1] = aim(
            airframe, wind, state, extent.width / 2, extent.height / 2, False
        )

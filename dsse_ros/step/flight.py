# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The step of a drone that flies in metres, compiled; see `flight_paths` and `sightings`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.compiled.draws import draw_unit
from dsse_ros.compiled.jit import inlined, kernel, part
from dsse_ros.step.ensemble_kernels import step_of
from dsse_ros.step.flight_paths import Wind, largest_turn, share_of, write_path
from dsse_ros.step.sightings import is_far, missed
from dsse_ros.targets.sea_map import is_open


class FlightTask(NamedTuple):
    """The flights of B worlds, or of one: then there is no axis B.

    Attributes:
        flyers: (K,) of `flight_paths.FLYERS`.
        eyes: (K,) of `sightings.EYES`.
        wind: The wind.
        cell_m: Side of a cell, m.
        truth: (M, T, 2) float32, metres: the tracks that persons follow, see `SeaEnsemble`.
        flights: (B, N) of `flight_paths.FLIGHTS`.
        paths: (B, N, K + 1, 2) float64, metres: paths of the drones in the last step.
        looked: (B, N, K + 1) bool: whether they looked right before the step and on each piece.
        preset: (B, N) bool: whether path and looks of the next step are there already, those of a
            vehicle.
        actions: (B, N, 2) float64, turns and speeds, see `flight_paths`.
    """

    flyers: NDArray[np.void]
    eyes: NDArray[np.void]
    wind: Wind
    cell_m: float
    truth: NDArray[np.float32]
    flights: NDArray[np.void]
    paths: NDArray[np.float64]
    looked: NDArray[np.bool_]
    preset: NDArray[np.bool_]
    actions: NDArray[np.float64]


@part
def flight_of(flight, b):
    """Return the flights of world b; None if drones move from cell to cell."""
    if flight is None:
        return None
    return FlightTask(
        flight.flyers, flight.eyes, flight.wind, flight.cell_m, flight.truth, flight.flights[b],
        flight.paths[b], flight.looked[b], flight.preset[b], flight.actions[b],
    )  # fmt: skip


@inlined
def start_flights(world, crew, flight):
    """Put the drones at the centres of their cells, at cruise, facing the last known cell."""
    if flight is None:
        return
    for n in range(len(crew.drones)):
        state, flyer = flight.flights[n], flight.flyers[crew.kinds[n]]
        state.east = (crew.starts[n, 0] + 0.5) * flight.cell_m
        state.south = (crew.starts[n, 1] + 0.5) * flight.cell_m
        east, south = world.start_x - crew.starts[n, 0], world.start_y - crew.starts[n, 1]
        state.heading, state.speed = math.atan2(float(east), float(-south)), flyer.cruise
        stay(flight, n)


@inlined
def stay(flight, n):
    """Write the path of drone n in a step in which it does not fly."""
    state = flight.flights[n]
    flight.preset[n] = False
    for k in range(flight.paths.shape[1]):
        flight.paths[n, k, 0], flight.paths[n, k, 1] = state.east, state.south
        flight.looked[n, k] = False


@inlined
def fly(constants, crew, flight, n):
    """Fly drone n for a step; return whether it is still over the grid.

    One that would leave the grid stops at its edge.
    """
    drone, state, path = crew.drones[n], flight.flights[n], flight.paths[n]
    looked, last = flight.looked[n], len(path) - 1
    if flight.preset[n]:
        flight.preset[n] = False
    else:
        write_action(flight.flyers[crew.kinds[n]], flight.wind, state, flight.actions[n], path)
        looked[0] = looked[last]
        for k in range(last):
            looked[k + 1] = True
    side, inside = constants.grid_size * flight.cell_m, True
    for k in range(len(path)):
        east, south = path[k, 0], path[k, 1]
        if not (0.0 <= east <= side and 0.0 <= south <= side):
            inside = False
            path[k, 0], path[k, 1] = min(max(east, 0.0), side), min(max(south, 0.0), side)
    state.east, state.south = path[-1, 0], path[-1, 1]
    edge = constants.grid_size - 1
    drone.x = min(np.int64(state.east / flight.cell_m), edge)
    drone.y = min(np.int64(state.south / flight.cell_m), edge)
    return inside


@inlined
def write_action(flyer, wind, state, action, path):
    """Write the path of an action, and the state after it; see `flight_paths`."""
    speed = flyer.slowest + 0.5 * (1.0 + share_of(action[1])) * (flyer.cruise - flyer.slowest)
    turn = share_of(action[0]) * largest_turn(flyer.radius, speed, wind.step_s)
    write_path(flyer, wind, state, turn, speed, path)


@inlined
def detect_in_passing(constants, world, sea, crew, flight, ensemble, n):
    """Draw whom drone n detects on its path; return the number of persons.

    A person counts where the sea has it before and after the step. One who is off the grid or
    outside the area before it is not seen.
    """
    eye, path, finds = flight.eyes[crew.kinds[n]], flight.paths[n], 0
    step = step_of(world, ensemble)
    after = min(step + 1, flight.truth.shape[1] - 1)
    for p in range(len(crew.persons)):
        person = crew.persons[p]
        gone = person.found and not constants.found_persons_stay
        if gone or not is_open(sea.area, constants.grid_size, person.x, person.y):
            continue
        track = flight.truth[ensemble.track[p]]
        place = (track[step, 0], track[step, 1], track[after, 0], track[after, 1])
        if is_far(eye.reach, path, place):
            continue
        looked, step_s = flight.looked[n], flight.wind.step_s
        miss = missed(eye, path, looked, step_s, place, person.pod_multiplier)
        if miss < 1.0 and draw_unit(world) >= miss:
            person.found = True
            finds += 1
    return finds


@kernel
def path_of_action(flyers, kind, wind, flight, action, path):
    """Write the path of an action from a state, (1,) of `flight_paths.FLIGHTS` in and out.

    Args:
        flyers: (K,) of `flight_paths.FLYERS`.
        kind: Number of the drone's kind.
        wind: A `Wind`.
        flight: The state.
        action: (2,) float64, turn and speed.
        path: (K + 1, 2) float64 out.
    """
    write_action(flyers[kind], wind, flight[0], action, path)

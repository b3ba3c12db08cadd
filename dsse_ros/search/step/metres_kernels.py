# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The step of a drone that flies in metres, compiled; see `metres_paths` and `metres_detection`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.draws import draw_unit
from dsse_ros.base.compiled.jit import inlined, kernel, part
from dsse_ros.base.compiled.records import Int
from dsse_ros.search.step.constants import Constants
from dsse_ros.search.step.ensemble_kernels import SeaEnsemble, step_of
from dsse_ros.search.step.entities import Entities, Records, WorldRecord
from dsse_ros.search.step.metres_detection import is_far, missed
from dsse_ros.search.step.metres_paths import (
    Airframe,
    MotionState,
    Path,
    Wind,
    largest_turn,
    share_of,
    write_path,
)
from dsse_ros.world.targets.sea_map import Sea, grid_of, is_open

FARTHEST_CELL = 2.0**15 - 1
"""Greatest column or row, as logs and reports have them, of a vehicle off the grid."""


class MetresArrays(NamedTuple):
    """The drones of B worlds in metres, or of one: then there is no axis B.

    Attributes:
        airframes: (K,) of `metres_paths.AIRFRAMES`.
        detectors: (K, A) of `metres_detection.DETECTORS`, by kind and appearance.
        wind: The wind.
        cell_m: Side of a cell, m.
        truth: (M, T, 2) float32, metres: the tracks that persons follow, see `SeaEnsemble`.
        states: (B, N) of `metres_paths.MOTION_STATES`.
        paths: (B, N, K + 1, 2) float64, metres: paths of the drones in the last step.
        looked: (B, N, K + 1) bool: whether they looked right before the step and on each piece.
        preset: (B, N) bool: whether path and looks of the next step are there already, those of a
            vehicle.
        actions: (B, N, 2) float64, turns and speeds, see `metres_paths`.
    """

    airframes: NDArray[np.void]
    detectors: NDArray[np.void]
    wind: Wind
    cell_m: float
    truth: NDArray[np.float32]
    states: NDArray[np.void]
    paths: NDArray[np.float64]
    looked: NDArray[np.bool_]
    preset: NDArray[np.bool_]
    actions: NDArray[np.float64]


@part
def metres_of(metres: MetresArrays | None, b: int) -> MetresArrays | None:
    """Return the drones of world b; None if drones move from cell to cell."""
    if metres is None:
        return None
    return MetresArrays(
        airframes=metres.airframes,
        detectors=metres.detectors,
        wind=metres.wind,
        cell_m=metres.cell_m,
        truth=metres.truth,
        states=metres.states[b],
        paths=metres.paths[b],
        looked=metres.looked[b],
        preset=metres.preset[b],
        actions=metres.actions[b],
    )


@inlined
def start_in_metres(world: WorldRecord, entities: Entities, metres: MetresArrays | None) -> None:
    """Put the drones at the centres of their cells, at cruise, facing the last known cell."""
    if metres is None:
        return
    for n in range(len(entities.drones)):
        state, airframe = metres.states[n], metres.airframes[entities.kinds[n]]
        state.east = (entities.start_cells[n, 0] + 0.5) * metres.cell_m
        state.south = (entities.start_cells[n, 1] + 0.5) * metres.cell_m
        east, south = (
            world.start_x - entities.start_cells[n, 0],
            world.start_y - entities.start_cells[n, 1],
        )
        state.heading, state.speed = math.atan2(float(east), float(-south)), airframe.cruise
        stay(metres, n)


@inlined
def stay(metres: MetresArrays, n: int) -> None:
    """Write the path of drone n in a step in which it does not fly."""
    state = metres.states[n]
    metres.preset[n] = False
    for k in range(metres.paths.shape[1]):
        metres.paths[n, k, 0], metres.paths[n, k, 1] = state.east, state.south
        metres.looked[n, k] = False


@inlined
def fly(constants: Constants, entities: Entities, metres: MetresArrays, n: int) -> bool:
    """Fly drone n for a step; return whether it has stayed over the grid.

    One that would leave the grid stops at its edge. The path that a vehicle reports is kept, even
    off the grid.
    """
    drone, state, path = entities.drones[n], metres.states[n], metres.paths[n]
    looked, last, by_vehicle = metres.looked[n], len(path) - 1, metres.preset[n]
    metres.preset[n] = False
    if not by_vehicle:
        write_action(
            metres.airframes[entities.kinds[n]], metres.wind, state, metres.actions[n], path
        )
        looked[0] = looked[last]
        for k in range(last):
            looked[k + 1] = True
    width, height = constants.columns * metres.cell_m, constants.rows * metres.cell_m
    inside = True
    for k in range(len(path)):
        east, south = path[k, 0], path[k, 1]
        if not (0.0 <= east <= width and 0.0 <= south <= height):
            inside = False
            if not by_vehicle:
                path[k, 0], path[k, 1] = min(max(east, 0.0), width), min(max(south, 0.0), height)
    state.east, state.south = path[-1, 0], path[-1, 1]
    drone.x = cell_at(state.east, metres.cell_m, width)
    drone.y = cell_at(state.south, metres.cell_m, height)
    return inside


@inlined
def cell_at(metres: float, cell_m: float, side: float) -> Int:
    """Return the column or row at a coordinate; the far edge of the grid belongs to its cells."""
    cell = min(max(metres / cell_m, -FARTHEST_CELL), FARTHEST_CELL)
    return np.int64(math.floor(cell)) - (1 if metres == side else 0)


@inlined
def write_action(
    airframe: Airframe, wind: Wind, state: MotionState, action: NDArray[np.float64], path: Path
) -> None:
    """Write the path of an action, and the state after it; see `metres_paths`."""
    speed = airframe.slowest + 0.5 * (1.0 + share_of(action[1])) * (
        airframe.cruise - airframe.slowest
    )
    turn = share_of(action[0]) * largest_turn(airframe.radius, speed, wind.step_s)
    write_path(airframe, wind, state, turn, speed, path)


@inlined
def detect_in_passing(
    constants: Constants,
    world: WorldRecord,
    sea: Sea,
    entities: Entities,
    metres: MetresArrays,
    ensemble: SeaEnsemble,
    n: int,
) -> int:
    """Draw whom drone n detects on its path; return the number of persons.

    A person drifts straight from its position before the step to the one after it. One who is off
    the grid or outside the area before the step is not seen.
    """
    detectors, path, finds = metres.detectors[entities.kinds[n]], metres.paths[n], 0
    step = step_of(world, ensemble)
    after = min(step + 1, metres.truth.shape[1] - 1)
    for p in range(len(entities.persons)):
        person = entities.persons[p]
        gone = person.found and not constants.found_persons_stay
        if gone or not is_open(sea.area, grid_of(constants), person.x, person.y):
            continue
        track = metres.truth[ensemble.track[p]]
        detector = detectors[ensemble.appearances[ensemble.track[p]]]
        place = (track[step, 0], track[step, 1], track[after, 0], track[after, 1])
        if is_far(detector.reach, path, place):
            continue
        looked, step_s = metres.looked[n], metres.wind.step_s
        miss = missed(detector, path, looked, step_s, place, person.pod_multiplier)
        if miss < 1.0 and draw_unit(world) >= miss:
            person.found = True
            finds += 1
    return finds


@kernel
def path_of_action(
    airframes: Records,
    kind: int,
    wind: Wind,
    state: Records,
    action: NDArray[np.float64],
    path: Path,
) -> None:
    """Write the path of an action from a state, (1,) of `metres_paths.MOTION_STATES` in and out.

    Args:
        airframes: (K,) of `metres_paths.AIRFRAMES`.
        kind: Number of the drone's kind.
        wind: A `Wind`.
        state: In and out.
        action: (2,) float64, turn and speed.
        path: (K + 1, 2) float64 out.
    """
    write_action(airframes[kind], wind, state[0], action, path)

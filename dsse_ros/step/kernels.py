# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled steps of B worlds at once; `recipe` has the step of one world.

The state of the worlds is in three structured arrays, `worlds` (B,), `drones` (B, N) and `persons`
(B, P). x is the column and grows to the east, y is the row and grows to the south.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.compiled.jit import expanded, inlined, kernel, part
from dsse_ros.compiled.streaming import ALIGNMENT, LANES
from dsse_ros.step.coverage_kernels import CoverageTask, coverage_of, write_left
from dsse_ros.step.ensemble_kernels import SeaEnsemble, ensemble_of, write_present
from dsse_ros.step.flight import FlightTask, flight_of
from dsse_ros.step.masks import mask_moves
from dsse_ros.step.recipe import WorldState, start_world, step_world
from dsse_ros.step.viewpoints import viewpoints_of
from dsse_ros.targets.sea_map import Sea, disperse, write_map

WORLDS = np.dtype(
    [
        ("rng", "u8"),  # state of the world's own generator
        ("t", "i8"),  # steps done
        ("map_steps", "i8"),
        ("datum_x", "i8"),
        ("datum_y", "i8"),
        ("circle_x", "i8"),
        ("circle_y", "i8"),
        ("remainder_x", "f8"),  # drift not yet applied, cells
        ("remainder_y", "f8"),
        ("vector_x", "f8"),  # the scenario's drift
        ("vector_y", "f8"),
        ("drift_x", "f8"),  # drift per step, cells
        ("drift_y", "f8"),
        ("scale", "f8"),  # 1 / sum of the Gaussian over the possible cells; 0: all in one cell
        ("start_x", "i8"),  # cell of the person at reset
        ("start_y", "i8"),
        ("num_active", "i8"),  # drones still in the search
        ("num_missing", "i8"),  # persons not found, or cells not covered
        ("done", "?"),  # the search has ended: none missing, time limit, or no drone left
    ],
    align=True,
)

DRONES = np.dtype(
    [
        ("x", "i8"),
        ("y", "i8"),
        ("episode_return", "f8"),  # sum of rewards without the replacements by collisions
        ("reward", "f8"),  # of the last step
        ("alive", "?"),  # in the search; a drone neither alive nor flagged was withdrawn
        ("terminated", "?"),  # since the last reset
        ("truncated", "?"),
        ("found", "?"),  # found a person in the last step
        ("clear", "?"),  # of the others, above them or on the ground: it does not collide
    ],
    align=True,
)


class Crew(NamedTuple):
    """The drones of B worlds, their looks, and the persons, or of one: then there is no axis B.

    Attributes:
        starts: (B, N, 2) int64, cells of the drones at reset.
        drones: (B, N) of `DRONES`.
        finds: (B, N) uint64, one bit per successful look of a drone that found a person in the last
            step; undefined for other drones.
        persons: (B, P) of `PERSONS`.
        kinds: (N,) of `looks.Looks.kind`.
        looks: (K, A + 1) of `looks.Looks.first`.
        offsets: (L, 2) of `looks.Looks`.
        pods: (L, P) of `looks.Looks`.
    """

    starts: NDArray[np.int64]
    drones: NDArray[np.void]
    finds: NDArray[np.uint64]
    persons: NDArray[np.void]
    kinds: NDArray[np.int64]
    looks: NDArray[np.int64]
    offsets: NDArray[np.int64]
    pods: NDArray[np.float64]


class Task(NamedTuple):
    """What the drones of B worlds look for, or of one: then there is no axis B.

    Attributes:
        coverage: The cells to cover; None in a search for persons.
        ensemble: The tracks that the persons follow; None if they move step by step.
        flight: The flights in metres; None if drones move from cell to cell.
        viewpoints: (B, N) of `viewpoints.VIEWPOINTS`; None if drones look in their own cells.
    """

    coverage: CoverageTask | None
    ensemble: SeaEnsemble | None
    flight: FlightTask | None
    viewpoints: NDArray[np.void] | None


class Scratch(NamedTuple):
    """Memory of a thread.

    Attributes:
        occupied: (G * G + 1,) uint16, see `occupy`.
        circle: (G + 1,) int64, see `update_circle`.
        cells: (K,) int64, the cells over which persons are scattered.
        span: (G,) float64.
    """

    occupied: NDArray[np.uint16]
    circle: NDArray[np.int64]
    cells: NDArray[np.int64]
    span: NDArray[np.float64]


class Batch(NamedTuple):
    """B worlds: all that their steps read and write.

    Attributes:
        constants: (1,) of `constants.CONSTANTS`, never written.
        worlds: (B,) of `WORLDS`.
        sea: Their sea.
        crew: Their drones and persons.
        task: What the drones look for.
    """

    constants: NDArray[np.void]
    worlds: NDArray[np.void]
    sea: Sea
    crew: Crew
    task: Task


class Report(NamedTuple):
    """What a step reports of the drones of B worlds.

    Attributes:
        positions: (B, N, 2) int64, as (x, y).
        rewards: (B, N) float64.
        terminated: (B, N) bool.
        truncated: (B, N) bool.
        action_masks: (B, N, A) int8, 0 for moves out of the grid or the area.
    """

    positions: NDArray[np.int64]
    rewards: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    action_masks: NDArray[np.int8]


STREAMED_BYTES = 1 << 25
"""Larger maps are written past the caches, because they would not fit."""


@part
def is_streamed(maps):
    """Return whether maps (B, G, G) are large and aligned enough to be written past the caches."""
    if maps is None:
        return False
    large = maps.size * maps.itemsize > STREAMED_BYTES
    return large and maps.shape[1] % LANES == 0 and maps.ctypes.data % ALIGNMENT == 0


@inlined
def sea_of(sea, b):
    """Return the sea of world b."""
    table = min(b, len(sea.gauss) - 1)
    return Sea(sea.gauss[table], sea.tails[table], sea.area, sea.runs, sea.data)


@inlined
def crew_of(crew, b):
    """Return the drones and persons of world b."""
    return Crew(
        crew.starts[b], crew.drones[b], crew.finds[b], crew.persons[b],
        crew.kinds, crew.looks, crew.offsets, crew.pods,
    )  # fmt: skip


@inlined
def task_of(task, b):
    """Return the task of world b."""
    return Task(
        coverage_of(task.coverage, b), ensemble_of(task.ensemble, b), flight_of(task.flight, b),
        viewpoints_of(task.viewpoints, b),
    )  # fmt: skip


@expanded
def state_of(batch, b):
    """Return world b."""
    return WorldState(
        batch.constants[0], batch.worlds[b], sea_of(batch.sea, b), crew_of(batch.crew, b),
        task_of(batch.task, b),
    )  # fmt: skip


@part
def map_of(maps, b):
    """Return the map of world b; None without maps, and (0, 0) if none are written."""
    if maps is None:
        return None
    return maps[b]


@inlined
def write_observed(state, scratch, stream, out, coverage, ensemble):
    """Write the observed map of a world, or its probability left to cover, to `out` of `map_of`."""
    if out is None:
        return
    if len(out) == 0:
        return
    if ensemble is not None:
        write_present(state.world, ensemble, out)
    elif coverage is None:
        write_map(state.constants, state.world, state.sea, scratch, stream, out)
    else:
        write_left(coverage, out)


@kernel
def step_worlds(batch, scratch, actions, maps, first, last):
    """Advance the worlds first..last - 1 by one step and write their maps.

    Args:
        batch: The worlds.
        scratch: Of the thread.
        actions: (B, N) int8; a number that is not an action does nothing.
        maps: (B, G, G) float32 out as [y, x], C-contiguous; (B, 0, 0) or None to write none.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    stream = is_streamed(maps)
    for b in range(first, last):
        state = state_of(batch, b)
        task = state.task
        if state.constants.auto_reset and state.world.done:
            start_world(state, scratch)
        else:
            step_world(state, scratch, actions[b], task.coverage, task.flight, task.viewpoints)
        write_observed(state, scratch, stream, map_of(maps, b), task.coverage, task.ensemble)


@kernel
def reset_worlds(batch, scratch, maps, which, first, last):
    """Reset those of the worlds first..last - 1 with which[b], (B,) bool; see `step_worlds`."""
    stream = is_streamed(maps)
    for b in range(first, last):
        if which[b]:
            state = state_of(batch, b)
            start_world(state, scratch)
            write_observed(
                state, scratch, stream, map_of(maps, b), state.task.coverage, state.task.ensemble
            )


@kernel
def refresh_worlds(batch, scratch, maps):
    """Write the tables and the maps that the state requires, see `step_worlds`."""
    constants, worlds = batch.constants[0], batch.worlds
    stream = is_streamed(maps)
    for b in range(len(batch.sea.gauss)):
        disperse(constants, worlds[b], sea_of(batch.sea, b))
    for b in range(len(worlds)):
        state = state_of(batch, b)
        write_observed(state, scratch, stream, maps[b], state.task.coverage, state.task.ensemble)


@kernel
def report_worlds(constants, area, drones, report, first, last):
    """Write the report of the drones of the worlds first..last - 1.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        area: Of `Sea`.
        drones: (B, N) of `DRONES`.
        report: Out.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    for b in range(first, last):
        of_world, cells, masks = drones[b], report.positions[b], report.action_masks[b]
        rewards, terminated = report.rewards[b], report.terminated[b]
        truncated = report.truncated[b]
        masks[:] = 1
        for n in range(len(of_world)):
            drone = of_world[n]
            x, y = drone.x, drone.y
            cells[n, 0], cells[n, 1] = x, y
            rewards[n] = drone.reward
            terminated[n], truncated[n] = drone.terminated, drone.truncated
            mask_moves(constants[0], area, x, y, masks[n])

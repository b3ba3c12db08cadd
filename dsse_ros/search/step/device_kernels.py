# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The steps of B worlds on a CUDA device: each thread calls the compiled functions for one world.

Numba compiles the functions of `kernels` and `fault_kernels` for the device as they are. Maps are
computed cell by cell, so that the threads of a block write neighbours.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import cuda, types
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import inlined, kernel
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.step.constants import NO_ACTION, Constants
from dsse_ros.search.step.coverage_kernels import CoverageTask
from dsse_ros.search.step.ensemble_kernels import SeaEnsemble, probability_in
from dsse_ros.search.step.entities import Actions, Area, Maps, Records, WorldRecord
from dsse_ros.search.step.fault_kernels import FaultArrays, after_step, before_step, restrict_masks
from dsse_ros.search.step.kernels import extensions_of, report_worlds, sea_of, step_worlds
from dsse_ros.search.step.world_state import Batch, Report, Scratch
from dsse_ros.world.targets.sea_map import (
    grid_of,
    is_inside,
    middle_of,
    weighted_probability,
)

THREADS = 64
"""Threads of a block with a thread for each world."""

MAP_THREADS = 256
"""Threads of a block for each world."""


def map_block(grid: GridShape) -> tuple[int, int]:
    """Return the threads of a block along the columns and rows of a map."""
    columns = min(grid.columns, MAP_THREADS)
    return columns, MAP_THREADS // columns


class Infos(NamedTuple):
    """Further values that a step reports of B worlds; None for those that they do not have.

    Attributes:
        found: (B,) bool, whether every person is found, or every cell covered.
        step: (B,) int64, steps done.
        over: (B,) bool, whether the search has ended.
        status: (B, N) int8 of `fault_kernels.CONDITIONS`.
        action: (B, N) int8, the action that the drone did, `NO_ACTION` for nothing.
        battery: (B, N) float64, percent; without batteries it is not reported.
        coverage_rate: (B,) float64, see `coverage_task.Coverage.metrics`.
        repeated_coverage: (B,) float64, see there.
        pos: (B,) float64, see there.
    """

    found: NDArray[np.bool_]
    step: NDArray[np.int64]
    over: NDArray[np.bool_]
    status: NDArray[np.int8] | None = None
    action: NDArray[np.int8] | None = None
    battery: NDArray[np.float64] | None = None
    coverage_rate: NDArray[np.float64] | None = None
    repeated_coverage: NDArray[np.float64] | None = None
    pos: NDArray[np.float64] | None = None


class Before(NamedTuple):
    """What a belief needs of B worlds as they were before a step.

    Attributes:
        alive: (B, N) bool, the drones in the search.
        done: (B,) bool, the worlds whose search had ended.
    """

    alive: NDArray[np.bool_]
    done: NDArray[np.bool_]


class Exchange(NamedTuple):
    """What a step reads and reports.

    Attributes:
        actions: (B, N) int8, or commands of drones with faults.
        steps: (B,) bool, the worlds that step; the others are only reported.
        maps: Of `kernels.step_worlds`: None, because `write_maps` writes them.
        before: Out, of the worlds that step.
        report: Out.
        infos: Out.
    """

    actions: NDArray[np.int8]
    steps: NDArray[np.bool_]
    maps: None
    before: Before
    report: Report
    infos: Infos


class Restart(NamedTuple):
    """New missions for some of B worlds.

    Attributes:
        which: (B,) bool, the worlds that restart.
        seeded: (B,) bool, those among them whose generator gets a new state.
        words: (B,) uint64, these states.
        worlds: (1,) of `entities.WORLDS`, with the vector and the person's cell at the start.
        starts: (1, N, 2) int64, cells of the drones at the start.
        persons: (1, P) of `motion.PERSONS`, with the POD multipliers.
    """

    which: NDArray[np.bool_]
    seeded: NDArray[np.bool_]
    words: NDArray[np.uint64]
    worlds: NDArray[np.void]
    starts: NDArray[np.int64]
    persons: NDArray[np.void]


class _Nothing:
    """Passes None to a kernel as a null pointer; Numba's CUDA target passes no argument for it."""

    @staticmethod
    def prepare_args(kind: Any, value: Any, **_: Any) -> tuple[Any, Any]:
        """Return the type and the value to pass."""
        return (types.uint64, 0) if kind == types.none else (kind, value)


def device_kernel(function: Callable[..., None]) -> Any:
    """Compile a kernel whose arguments may be tuples with None."""
    dispatcher = cuda.jit(function)
    dispatcher.extensions.append(_Nothing())
    return dispatcher


@device_kernel
def step(batch: Batch, faults: FaultArrays | None, scratch: Scratch, exchange: Exchange) -> None:
    """Advance those of B worlds that step, and report all of them; a thread for each world.

    Args:
        batch: A `world_state.Batch`.
        faults: A `fault_kernels.FaultArrays`; None without faults.
        scratch: A `world_state.Scratch` with a first axis of B worlds, but for `span`.
        exchange: An `Exchange`.
    """
    b = cuda.grid(1)
    if b >= len(batch.worlds):
        return
    if exchange.steps[b]:
        note(batch.worlds, batch.entities.drones, exchange.before, b)
        own = Scratch(scratch.occupied[b], scratch.circle[b], scratch.cells[b], scratch.span)
        if faults is None:
            step_worlds(batch, own, exchange.actions, exchange.maps, b, b + 1)
        else:
            before_step(batch, faults, exchange.actions, b, b + 1)
            step_worlds(batch, own, faults.applied, exchange.maps, b, b + 1)
            after_step(batch, faults, b, b + 1)
    report, infos = exchange.report, exchange.infos
    report_worlds(batch.constants, batch.sea.area, batch.entities.drones, report, b, b + 1)
    write_progress(batch.worlds, infos.found, infos.step, infos.over, b)
    if faults is not None:
        restrict_masks(batch, faults, report.action_masks, b, b + 1)
        write_conditions(
            faults.conditions, report.positions, infos.status, infos.action, infos.battery, b
        )
    write_metrics(
        batch.worlds, batch.extensions.coverage, infos.coverage_rate, infos.repeated_coverage,
        infos.pos, b,
    )  # fmt: skip


@kernel
def note(worlds: Records, drones: Records, before: Before, b: int) -> None:
    """Write the state before a step."""
    before.done[b] = worlds[b].done
    for n in range(drones.shape[1]):
        before.alive[b, n] = drones[b, n].alive


@kernel
def write_progress(
    worlds: Records,
    found: NDArray[np.bool_],
    step: NDArray[np.int64],
    over: NDArray[np.bool_],
    b: int,
) -> None:
    """Write the infos that every world has."""
    world = worlds[b]
    found[b] = world.num_missing == 0
    step[b] = world.t
    over[b] = world.done


@kernel
def write_conditions(
    conditions: Records,
    positions: NDArray[np.int64],
    status: Any,
    action: Any,
    battery: NDArray[np.float64] | None,
    b: int,
) -> None:
    """Write the infos of drones with faults, of `Infos`, and the positions that they report."""
    for n in range(conditions.shape[1]):
        condition = conditions[b, n]
        positions[b, n, 0], positions[b, n, 1] = condition.seen_x, condition.seen_y
        status[b, n] = condition.status
        action[b, n] = condition.applied
        if battery is not None:
            battery[b, n] = condition.battery


@kernel
def write_metrics(
    worlds: Records,
    coverage: CoverageTask | None,
    coverage_rate: Any,
    repeated_coverage: Any,
    pos: Any,
    b: int,
) -> None:
    """Write the metrics of the coverage task, of `Infos`: None without one."""
    if coverage is not None:
        record = coverage.records[b]
        coverage_rate[b] = (record.cells - worlds[b].num_missing) / record.cells
        repeated_coverage[b] = record.repeated / record.cells
        pos[b] = record.pos


@device_kernel
def restart(batch: Batch, new: Restart) -> None:
    """Let the next step of those of B worlds that restart begin a mission; a thread for each."""
    b = cuda.grid(1)
    if b < len(batch.worlds) and new.which[b]:
        place(batch, new, b)


@kernel
def place(batch: Batch, new: Restart, b: int) -> None:
    """Write the values of a `Restart` to world b."""
    world, placed = batch.worlds[b], new.worlds[0]
    if new.seeded[b]:
        world.rng = new.words[b]
    world.vector_x, world.vector_y = placed.vector_x, placed.vector_y
    world.start_x, world.start_y = placed.start_x, placed.start_y
    world.done = True
    for n in range(new.starts.shape[1]):
        for axis in range(2):
            batch.entities.start_cells[b, n, axis] = new.starts[0, n, axis]
    for p in range(new.persons.shape[1]):
        batch.entities.persons[b, p].pod_multiplier = new.persons[0, p].pod_multiplier


@cuda.jit  # type: ignore[untyped-decorator]
def take_actions(
    commanded: NDArray[np.integer[Any]],
    count: int,
    noop: bool,
    worlds: Records,
    drones: Records,
    actions: Actions,
    wrong: NDArray[np.int64],
) -> None:
    """Write commanded actions, and `NO_ACTION` for other numbers; a thread for each world.

    Args:
        commanded: (B, N) integers.
        count: Number of actions.
        noop: Whether the rules count other numbers as nothing.
        worlds: (B,) of `entities.WORLDS`.
        drones: (B, N) of `entities.DRONES`.
        actions: (B, N) int8 out.
        wrong: (2,) int64 out: if the rules do not, 1 and such a number of a drone in the search.
    """
    b = cuda.grid(1)
    if b < len(worlds):
        for n in range(commanded.shape[1]):
            action = commanded[b, n]
            known = action >= 0 and action < count
            actions[b, n] = action if known else NO_ACTION
            acts = drones[b, n].alive and not worlds[b].done
            if acts and not known and action != NO_ACTION and not noop:
                wrong[1] = action
                wrong[0] = 1


@kernel
def exponential(batch: Batch, b: int, axis: int, place: int) -> float:
    """Return the exponential of `Sea.gauss` of a column (axis 0) or a row (1) of world b."""
    world = batch.worlds[b]
    datum = world.datum_x if axis == 0 else world.datum_y
    return sea_of(batch.sea, b).gauss[axis, middle_of(batch.constants[0]) + place - datum]


@kernel
def shown(batch: Batch, b: int, x: int, y: int, across: float, along: float) -> float:
    """Return what the map of world b shows in a cell of the grid, from its exponentials."""
    extensions = extensions_of(batch.extensions, b)
    return shown_in(
        batch.constants[0], batch.worlds[b], batch.sea.area, (x, y, across, along),
        extensions.coverage, extensions.ensemble,
    )  # fmt: skip


@inlined
def shown_in(
    constants: Constants,
    world: WorldRecord,
    area: Area,
    cell: tuple[int, int, float, float],
    coverage: CoverageTask | None,
    ensemble: SeaEnsemble | None,
) -> float:
    """See `shown`; `cell` has its last four arguments."""
    x, y, across, along = cell
    if ensemble is not None:
        return probability_in(constants, world, ensemble, x, y)
    if coverage is not None:
        return coverage.left[y, x]
    return weighted_probability(constants, world, area, x, y, across, along)


@kernel
def observed(batch: Batch, b: int, x: int, y: int) -> float:
    """Return what the map of world b shows in the cell (x, y), 0 outside the grid and the area."""
    if not is_inside(grid_of(batch.constants[0]), x, y):
        return 0.0
    across, along = exponential(batch, b, 0, x), exponential(batch, b, 1, y)
    return shown(batch, b, x, y, across, along)


@device_kernel
def write_maps(batch: Batch, out: tuple[Maps]) -> None:
    """Write the maps of B worlds; a block for each world, with a thread for each column.

    Neighbouring columns have their exponentials far apart in memory, so that each is read once.

    Args:
        batch: A `world_state.Batch`.
        out: ((B, R, C) float32 out as [y, x],).
    """
    b, (_, rows, columns) = cuda.blockIdx.x, out[0].shape
    for x in range(cuda.threadIdx.x, columns, cuda.blockDim.x):
        across = exponential(batch, b, 0, x)
        for y in range(cuda.threadIdx.y, rows, cuda.blockDim.y):
            out[0][b, y, x] = shown(batch, b, x, y, across, exponential(batch, b, 1, y))


@device_kernel
def write_windows(batch: Batch, windows: tuple[NDArray[np.int64], NDArray[np.float32]]) -> None:
    """Write windows of the maps of B worlds; a block for each world.

    Args:
        batch: A `world_state.Batch`.
        windows: ((B, K, 2) int64 centres as (x, y), (B, K, W, W) float32 out as [y, x]), with W
            odd.
    """
    b, (centres, out) = cuda.blockIdx.x, windows
    side = out.shape[2]
    for i in range(cuda.threadIdx.x, out.shape[1] * side * side, cuda.blockDim.x):
        k, row, col = i // (side * side), i // side % side, i % side
        x, y = centres[b, k, 0] + col - side // 2, centres[b, k, 1] + row - side // 2
        out[b, k, row, col] = observed(batch, b, x, y)

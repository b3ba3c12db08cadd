# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The beliefs of B worlds about a single person on a CUDA device: a block for each world.

The filter is that of `component_kernels` and `component_motion`, from the same tables of moves. The
threads of a block share the cells. Nothing is normalised: a world keeps the sum of its belief, and
that of its layers in each cell, which its map shows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import cuda, float64
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import kernel
from dsse_ros.search.belief.component_kernels import NOTHING_LEFT
from dsse_ros.search.belief.component_motion import PER_DRIFT
from dsse_ros.search.belief.look_kernels import list_looks
from dsse_ros.search.belief.motion_kernels import (
    MARGIN,
    NEGLIGIBLE,
    complete,
    index_of,
    offset_of,
    step_of_drift,
    tables_at,
)
from dsse_ros.search.step.device_kernels import device_kernel
from dsse_ros.search.step.recipe import acts_at
from dsse_ros.world.targets.motion import STAND_STILL, STEPS

THREADS = 256
"""Threads of a block."""


class DeviceMass(NamedTuple):
    """The beliefs of B worlds, up to a factor for each.

    Attributes:
        layers: (B, K, S) float64, see `component_kernels`; a row for each drift.
        cells: (B, S) float64, the sums of the layers.
        totals: (B,) float64, the sums of the cells.
        pos: (B,) float64, the POS of all searches of each mission.
    """

    layers: NDArray[np.float64]
    cells: NDArray[np.float64]
    totals: NDArray[np.float64]
    pos: NDArray[np.float64]


class DeviceTables(NamedTuple):
    """Tables for all missions of a scenario: T steps of the sea.

    Attributes:
        start: (K, S) float64, the belief at a mission's first observation.
        chances: (T, S) float64, of `MotionTables`.
        tables: (T, `CHANCES`, S) float64, of `MotionTables`, without gaps.
        directions: (T, K) int64, of `MotionTables`.
        sources: (9, S) int16: for each direction of a drift and each cell a bit for each step by
            which the drift brings persons there; (1, 0) if persons have no drift of their own.
        pods: (L,) float64, POD of each look.
        first_step: (1,) int64, steps of the sea before a mission's first observation.
    """

    start: NDArray[np.float64]
    chances: NDArray[np.float64]
    tables: NDArray[np.float64]
    directions: NDArray[np.int64]
    sources: NDArray[np.int16]
    pods: NDArray[np.float64]
    first_step: NDArray[np.int64]


class DeviceLooks(NamedTuple):
    """The looks of the last step of B worlds, at most Q each; first those that found nobody.

    Attributes:
        seen: (B, Q, 2) int64, cells as (x, y), on the grid or off it.
        rows: (B, Q) int64, numbers of the looks.
        counts: (B, 3) int64: looks that found nobody, looks, and the step's number in the tables.
    """

    seen: NDArray[np.int64]
    rows: NDArray[np.int64]
    counts: NDArray[np.int64]


@kernel
def list_step(done, first_step, looks, b):
    """Write the looks of the step of world b."""
    counts, t = looks.counts[b], done.batch.worlds[b].t - 1
    counts[0] = counts[1] = 0
    counts[2] = first_step[0] + t
    if acts_at(done.batch.constants[0], t):
        counts[0], counts[1] = list_looks(done, b, looks.seen[b], looks.rows[b])


@cuda.jit(device=True)
def sum_of_block(values, shared):
    """Return the sum of an array to all threads of a block; `shared` has room for a number each."""
    thread, threads = cuda.threadIdx.x, cuda.blockDim.x
    cuda.syncthreads()
    part = 0.0
    for i in range(thread, len(values), threads):
        part += values[i]
    shared[thread] = part
    cuda.syncthreads()
    total = 0.0
    for k in range(threads):
        total += shared[k]
    cuda.syncthreads()
    return total


@cuda.jit(device=True)
def learn(mass, tables, looks, one_find, pitch, b, shared):
    """Update the belief of world b with its looks, see `filter_kernels.learn_of_one`."""
    thread, threads = cuda.threadIdx.x, cuda.blockDim.x
    layers, cells = mass.layers[b], mass.cells[b]
    columns, rows = pitch - 2 * MARGIN, len(cells) // pitch - 2 * MARGIN
    total = mass.totals[b]
    failed, number, slot = looks.counts[b, 0], looks.counts[b, 1], looks.counts[b, 2]
    for turn in range(2):
        taken = 0.0
        for q in range(failed if turn == 1 else 0, number if turn == 1 else failed):
            x, y, pod = looks.seen[b, q, 0], looks.seen[b, q, 1], tables.pods[looks.rows[b, q]]
            if x < 0 or y < 0 or x >= columns or y >= rows:
                continue
            i = (y + MARGIN) * pitch + x + MARGIN
            if turn == 1 and one_find:
                if thread == 0:
                    mass.pos[b] += (1.0 - mass.pos[b]) * cells[i] * pod / total
                continue
            for k in range(thread, len(layers), threads):
                layers[k, i] -= layers[k, i] * pod
            if thread == 0:
                taken += cells[i] * pod
                cells[i] -= cells[i] * pod
        if turn == 1 and one_find or failed == (0 if turn == 0 else number):
            continue
        left = sum_of_block(cells, shared)
        if thread == 0:
            mass.pos[b] += (1.0 - mass.pos[b]) * min(taken / total, 1.0)
        if left < NOTHING_LEFT * total:
            for i in range(thread, len(cells), threads):
                for k in range(len(layers)):
                    layers[k, i] = tables.chances[slot, i]
                cells[i] = len(layers) * tables.chances[slot, i]
            left = sum_of_block(cells, shared)
        total = left
    if thread == 0:
        mass.totals[b] = total
    cuda.syncthreads()


@cuda.jit(device=True)
def move_layer(layer, cells, table, negligible, pitch, shared):
    """Advance a layer by the persons' step, see `component_motion.predict`.

    Args:
        layer: (S,) float64.
        cells: (S,) float64.
        table: (`CHANCES`, S) float64.
        negligible: Probability up to which a cell counts as empty.
        pitch: Columns from one row of cells to the next.
        shared: (S,) float64.
    """
    thread, threads = cuda.threadIdx.x, cuda.blockDim.x
    for i in range(thread, len(layer), threads):
        shared[i] = layer[i] if layer[i] > negligible else 0.0
    cuda.syncthreads()
    # The outermost cells are always empty.
    for i in range(thread + pitch + 1, len(layer) - pitch - 1, threads):
        after = 0.0
        for step in range(STEPS):
            start = i - (step // 3 - 1) * pitch - step % 3 + 1
            after += shared[start] * table[step, start]
        cells[i] += after - layer[i]
        layer[i] = after
    cuda.syncthreads()


@cuda.jit(device=True)
def move_drifting(layer, cells, chances, added, sources, negligible, pitch, shared):
    """Advance a layer of persons with own drifts by the step of `drawn_cell`.

    A cell's probability, divided by that of its window, goes to each cell of the window by the
    chance of that cell, and to the one drifted to by `DRIFT_WEIGHT`. So a cell reads a window of
    quotients instead of nine tables.

    Args:
        layer: (S,) float64.
        cells: (S,) float64.
        chances: (S,) float64.
        added: (S,) float64, the addition by own drift.
        sources: (S,) int16 of the layer's direction.
        negligible: Probability up to which a cell counts as empty.
        pitch: Columns from one row of cells to the next.
        shared: (S,) float64.
    """
    thread, threads = cuda.threadIdx.x, cuda.blockDim.x
    for i in range(thread, len(layer), threads):
        shared[i] = layer[i] * added[i] if layer[i] > negligible else 0.0
    cuda.syncthreads()
    # The outermost cells are always empty.
    for i in range(thread + pitch + 1, len(layer) - pitch - 1, threads):
        window = drifted = 0.0
        of_drift = sources[i]
        for step in range(STEPS):
            share = shared[i - (step // 3 - 1) * pitch - step % 3 + 1]
            window += share
            if of_drift >> step & 1:
                drifted += share
        after = window * chances[i] * PER_DRIFT + drifted
        cells[i] += after - layer[i]
        layer[i] = after
    cuda.syncthreads()


@device_kernel
def follow(done, mass, tables, looks, steps, pitch, one_find, own_drift):
    """Update the beliefs of B worlds after a step, see `filter_kernels.filter_worlds`.

    Args:
        done: A `look_kernels.StepDone`.
        mass: A `DeviceMass`, in and out.
        tables: A `DeviceTables`.
        looks: A `DeviceLooks`: scratch.
        steps: (B,) bool, the worlds that stepped; the others stay as they are.
        pitch: Columns from one row of cells to the next.
        one_find: Whether a search finds at most one person.
        own_drift: Whether persons have drifts of their own.
    """
    b, thread, threads = cuda.blockIdx.x, cuda.threadIdx.x, cuda.blockDim.x
    shared = cuda.shared.array(0, float64)
    if not steps[b]:
        return
    layers, cells = mass.layers[b], mass.cells[b]
    if done.over[b]:
        for i in range(thread, len(cells), threads):
            total = 0.0
            for k in range(len(layers)):
                layers[k, i] = tables.start[k, i]
                total += layers[k, i]
            cells[i] = total
        if thread == 0:
            mass.totals[b], mass.pos[b] = 1.0, 0.0
        return
    if thread == 0:
        list_step(done, tables.first_step, looks, b)
    cuda.syncthreads()
    learn(mass, tables, looks, one_find, pitch, b, shared)
    slot, negligible = looks.counts[b, 2], NEGLIGIBLE * mass.totals[b]
    chances, table = tables.chances[slot], tables.tables[slot]
    for k in range(len(layers)):
        direction = tables.directions[slot, k]
        if direction == STAND_STILL:
            continue
        if own_drift:
            move_drifting(
                layers[k], cells, chances, table[STEPS], tables.sources[direction], negligible,
                pitch, shared,
            )  # fmt: skip
        else:
            move_layer(layers[k], cells, table, negligible, pitch, shared)


@device_kernel
def write_beliefs(mass, out):
    """Write the probability of every cell; a block for each world.

    Args:
        mass: A `DeviceMass`.
        out: ((B, R, C) float32 out as [y, x],).
    """
    b, (_, rows, columns) = cuda.blockIdx.x, out[0].shape
    cells, total = mass.cells[b], mass.totals[b]
    for i in range(cuda.threadIdx.x, rows * columns, cuda.blockDim.x):
        y, x = i // columns, i % columns
        here = cells[(y + MARGIN) * (columns + 2 * MARGIN) + x + MARGIN] / total
        # Rounding may put a sum of shares below 0 or above 1.
        out[0][b, y, x] = min(max(here, 0.0), 1.0)


@kernel
def complete_steps(constants, sea, steps, row):
    """Compute the columns of all cells in the tables of all steps.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        sea: Of the scenario.
        steps: A `MotionTables`.
        row: (`ROW`,) float64 scratch.
    """
    for slot in range(len(steps.directions)):
        step = tables_at(steps, slot)
        for i in range(steps.chances.shape[1]):
            complete(constants[0], sea, step, i, row)


@kernel
def write_sources(constants, area, out):
    """Write the sources of the cells, see `DeviceTables`; `out` is all 0."""
    for direction in range(len(out)):
        for y in range(constants[0].rows):
            for x in range(constants[0].columns):
                step = step_of_drift(constants[0], area, x, y, direction)
                to = index_of(constants[0], x, y) + offset_of(constants[0], step)
                out[direction, to] |= 1 << step

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled motion of a belief in cells: what a step of the persons makes of its components.

`predict_plainly` has the formula: each cell passes its probability on to its neighbours. `predict`
computes the same for the cells of the boxes only, by what each cell receives, in these steps for
each component that moves:

1. `shrink` takes columns without a noticeable probability from the ends of its box.
2. `copy_to_frame` copies the box into a `Frame`, in which every cell has all its neighbours, and
   takes it from the sums of the class.
3. `receive_by_table` writes what each cell receives from its nine neighbours back to the
   component, and adds it to the sums. If each person has an own drift, `receive_with_drift` does
   this from fewer numbers, and `keep_in_area` corrects it at the borders.
4. The box has grown by a cell on each side; `shrink` takes rows from its ends.

Loops over slices of equal lengths are in functions without other arguments, which the compiler
vectorizes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import compiled, inlined, kernel, part
from dsse_ros.base.compiled.prefetching import prefetch
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.belief.component_kernels import (
    EAST,
    FIRST_COLUMN,
    FIRST_ROW,
    NORTH,
    PITCH,
    SOUTH,
    WEST,
    Mass,
    stored_at,
)
from dsse_ros.search.belief.motion_kernels import (
    MARGIN,
    NEGLIGIBLE,
    ROW,
    Floats,
    Ints,
    MotionTables,
    complete,
    index_of,
    move_probabilities,
    offset_of,
    pitch_of,
    step_of_drift,
)
from dsse_ros.search.step.constants import Constants
from dsse_ros.world.targets.drawn_cell import DRIFT_WEIGHT
from dsse_ros.world.targets.motion import STAND_STILL, STEPS
from dsse_ros.world.targets.sea_map import Sea

PER_DRIFT = 1.0 / DRIFT_WEIGHT
VECTOR = 4
"""Columns of a frame are a multiple of this: loops over them need no remainder."""
LINE = 8
"""Cells in a cache line."""


@compiled()
def predict_plainly(
    constants: NDArray[np.void], sea: Sea, density: Floats, tables: MotionTables, after: Floats
) -> None:
    """Advance components by the persons' step, cell by cell, without boxes.

    Args:
        density: (C K, S) float64, as from `unpack`.
        after: (C K, S) float64 out.
    """
    row = np.empty(ROW)
    after[:] = 0.0
    for k in range(len(density)):
        direction = tables.directions[k % len(tables.directions)]
        for i in range(density.shape[1]):
            if direction == STAND_STILL:
                after[k, i] = density[k, i]
            elif density[k, i] > 0.0:
                move_probabilities(constants[0], sea, tables, i, direction, row)
                for move in range(STEPS):
                    after[k, i + offset_of(constants[0], move)] += row[move] * density[k, i]


@kernel
def predict(
    constants: NDArray[np.void], sea: Sea, mass: Mass, tables: MotionTables, scratch: Floats
) -> None:
    """Advance a belief by the persons' step; its totals do not change.

    Args:
        scratch: Of `new_scratch`.
    """
    moving = -1
    for k in range(len(mass.components)):
        direction, box = tables.directions[k % len(tables.directions)], mass.boxes[k]
        if direction == STAND_STILL or box[WEST] >= box[EAST] or box[NORTH] >= box[SOUTH]:
            continue
        if moving >= 0:
            request(mass.components[k], box)
            move_component(constants[0], sea, mass, moving, tables, scratch)
        moving = k
    if moving >= 0:
        move_component(constants[0], sea, mass, moving, tables, scratch)


@part
def request(component: Floats, box: Ints) -> None:
    """Request the memory of a component before and after its step."""
    rows, columns = box[SOUTH] - box[NORTH] + 2, box[EAST] - box[WEST] + 2 + VECTOR
    for i in range(0, rows * columns, LINE):
        prefetch(component, i)


def new_scratch(cells: int) -> NDArray[np.float64]:
    """Return memory for `predict` with S cells.

    It begins with the cells of a frame between two empty ones; the rest is for sums of them. Its
    end is the row of `complete`.
    """
    return np.empty(2 * cells + 2 + ROW)


@part
def move_component(
    constants: Constants, sea: Sea, mass: Mass, k: int, tables: MotionTables, scratch: Floats
) -> None:
    """Advance component k of a belief by the persons' step: the steps 1 to 4 above."""
    drifts, padded = len(tables.directions), padded_of(constants)
    pitch = padded.columns
    component, box, cells = mass.components[k], mass.boxes[k], mass.cells[k // drifts]
    direction, negligible = tables.directions[k % drifts], NEGLIGIBLE * mass.totals[k // drifts]
    shrink(pitch, component, box, WEST, cells, negligible)
    frame = frame_of(padded, box)
    runs = box_runs(pitch, frame, box)
    table = tables.tables
    if copy_to_frame(constants, frame, runs, component, negligible, table, scratch, cells) > 0:
        complete_table(constants, sea, tables, component, negligible, box, scratch[-ROW:])
        # Once more with the whole table; the component is taken from the sums already.
        unused = scratch[len(component) + 2 :]
        copy_to_frame(constants, frame, runs, component, negligible, table, scratch, unused)
    # From here on the component is the inner rows of its frame: the outermost ones stay empty.
    box[FIRST_COLUMN], box[FIRST_ROW], box[PITCH] = frame.west, frame.north + 1, frame.width
    if constants.own_drift:
        receive_with_drift(pitch, frame, tables.chances, scratch, component, cells, direction)
        keep_in_area(constants, sea.area, frame, box, scratch, direction, component, cells)
    else:
        receive_by_table(pitch, frame, scratch, table, component, cells)
    grow(constants, box)
    # Rows now, while the cells are in the caches: before the next step they no longer are.
    shrink(pitch, component, box, NORTH, cells, negligible)


@inlined
def padded_of(constants: Constants) -> GridShape:
    """Return the shape of the grid with its margins."""
    return GridShape(pitch_of(constants), constants.rows + 2 * MARGIN)


@part
def grow(constants: Constants, box: Ints) -> None:
    """Add to a box the cells around it that persons can be in."""
    padded = padded_of(constants)
    # The outermost cells are always empty, and all off the grid unless persons walk there.
    low = 1 if constants.person_walks_blind else MARGIN
    box[WEST], box[EAST] = max(box[WEST] - 1, low), min(box[EAST] + 1, padded.columns - low)
    box[NORTH], box[SOUTH] = max(box[NORTH] - 1, low), min(box[SOUTH] + 1, padded.rows - low)


class Frame(NamedTuple):
    """The cells that a component's step can reach, and a border around them, which stays empty.

    Its memory is contiguous, row by row. After the step the component is its inner rows.

    Attributes:
        west, north: Its first column and row of cells.
        width, rows: Number of columns, a multiple of `VECTOR` or the pitch, and number of rows.
    """

    west: int
    north: int
    width: int
    rows: int


@part
def frame_of(padded: GridShape, box: Ints) -> Frame:
    """Return the frame of a component with this box, before its step."""
    west, east = max(box[WEST] - 2, 0), min(box[EAST] + 2, padded.columns)
    north, south = max(box[NORTH] - 2, 0), min(box[SOUTH] + 2, padded.rows)
    width = -(-(east - west) // VECTOR) * VECTOR
    if 2 * width > padded.columns:
        return Frame(0, north, padded.columns, south - north)
    return Frame(min(west, padded.columns - width), north, width, south - north)


@part
def inner_runs(pitch: int, frame: Frame) -> tuple[int, int]:
    """Return in how many runs of cells the inner rows of a frame are, and their length."""
    rows = frame.rows - 2
    if frame.width == pitch:
        return 1, rows * pitch
    return rows, frame.width


class Runs(NamedTuple):
    """The cells of a component's box as runs that are contiguous in the component and in its frame.

    A run is a row of the box; where box and frame have whole rows of cells, one run is the box.

    Attributes:
        number, length: Number of runs, and of cells in each.
        stored, pitch: Where the first run is in the component, and the cells to the next one.
        cell: The column of a belief of the first cell; the next run is a pitch further.
        framed: Where the first run is in the frame; the next one is a frame's width further.
    """

    number: int
    length: int
    stored: int
    pitch: int
    cell: int
    framed: int


@part
def box_runs(pitch: int, frame: Frame, box: Ints) -> Runs:
    """Return the runs of a component's box."""
    rows, west = box[SOUTH] - box[NORTH], box[WEST]
    number, length = rows, box[EAST] - west
    if frame.width == pitch and box[PITCH] == pitch:
        number, length, west = 1, rows * pitch, 0
    return Runs(
        number, length, stored_at(box, west, box[NORTH]), box[PITCH], box[NORTH] * pitch + west,
        (box[NORTH] - frame.north) * frame.width + west - frame.west,
    )  # fmt: skip


@part
def copy_to_frame(
    constants: Constants,
    frame: Frame,
    runs: Runs,
    component: Floats,
    negligible: float,
    table: Floats,
    before: Floats,
    cells: Floats,
) -> int:
    """Copy a component's box into its frame, and take it from the sums of its class.

    Negligible cells count as empty. With own drifts the copy is what drifts from each cell: its
    probability times that of a drift.

    Args:
        runs: Of the box.
        component: (S,), the cells of the box.
        table: (`CHANCES`, S) of `MotionTables`.
        before: Out: an empty cell, the frame, an empty cell.
        cells: (S,), the sums of the class, in and out.

    Returns:
        How many of the cells that are not negligible the table lacks.
    """
    n, unknown, end = runs.length, 0, frame.rows * frame.width + 2
    i, j, k = runs.stored, runs.cell, runs.framed + 1
    if runs.number == 1:
        before[:k] = before[k + n : end] = 0.0
    else:
        before[:end] = 0.0
    for _ in range(runs.number):
        here, out = component[i : i + n], before[k : k + n]
        sums = cells[j : j + n]
        if constants.own_drift:
            unknown += weigh_but_negligible(here, negligible, sums, table[STEPS, j : j + n], out)
        else:
            unknown += copy_but_negligible(here, negligible, table[0, j : j + n], sums, out)
        i += runs.pitch
        j += pitch_of(constants)
        k += frame.width
    return unknown


@inlined
def copy_but_negligible(
    component: Floats, negligible: float, known: Floats, sums: Floats, before: Floats
) -> int:
    """Copy cells, the negligible ones as empty, and take all from their sums.

    Returns:
        How many of those copied the table lacks.
    """
    unknown = 0
    for i in range(len(component)):
        here = component[i] if component[i] > negligible else 0.0
        sums[i] -= component[i]
        before[i] = here
        unknown += (here > 0.0) & (known[i] < 0.0)
    return unknown


@inlined
def weigh_but_negligible(
    component: Floats, negligible: float, sums: Floats, added: Floats, drifted: Floats
) -> int:
    """As `copy_but_negligible`, but write what drifts from each cell."""
    unknown = 0
    for i in range(len(component)):
        here = component[i] if component[i] > negligible else 0.0
        sums[i] -= component[i]
        drifted[i] = here * added[i]
        unknown += (here > 0.0) & (added[i] < 0.0)
    return unknown


@part
def complete_table(
    constants: Constants,
    sea: Sea,
    tables: MotionTables,
    component: Floats,
    negligible: float,
    box: Ints,
    row: Floats,
) -> None:
    """Fill in the motion tables for the cells of a component that are not negligible."""
    pitch = pitch_of(constants)
    for y in range(box[NORTH], box[SOUTH]):
        for x in range(box[WEST], box[EAST]):
            if component[stored_at(box, x, y)] > negligible:
                complete(constants, sea, tables, y * pitch + x, row)


@part
def receive_by_table(
    pitch: int, frame: Frame, before: Floats, table: Floats, component: Floats, cells: Floats
) -> None:
    """Write what the inner rows of a frame receive from all cells, and add it to the sums.

    A cell receives, from each of its nine neighbours, the neighbour's probability times that of
    the step from there.

    Args:
        frame: Of the component.
        before: Of `copy_to_frame`.
        table: (`CHANCES`, S) of `MotionTables`, the probabilities of the steps 0 to 8.
        component: The cells, out.
        cells: (S,), the sums of the class, in and out.
    """
    runs, n = inner_runs(pitch, frame)
    width, to = frame.width, (frame.north + 1) * pitch + frame.west
    for k in range(runs):
        # Where the steps 8 to 0 start: the rows a, d, g of the frame, p, q, r of the table.
        a, d, g = 1 + k * n, 1 + k * n + width, 1 + k * n + 2 * width
        p, q, r = to - pitch, to, to + pitch
        add_products(
            component[k * n : k * n + n],
            cells[q : q + n],
            (
                before[a - 1 : a - 1 + n], before[a : a + n], before[a + 1 : a + 1 + n],
                before[d - 1 : d - 1 + n], before[d : d + n], before[d + 1 : d + 1 + n],
                before[g - 1 : g - 1 + n], before[g : g + n], before[g + 1 : g + 1 + n],
            ),
            (
                table[8, p - 1 : p - 1 + n], table[7, p : p + n], table[6, p + 1 : p + 1 + n],
                table[5, q - 1 : q - 1 + n], table[4, q : q + n], table[3, q + 1 : q + 1 + n],
                table[2, r - 1 : r - 1 + n], table[1, r : r + n], table[0, r + 1 : r + 1 + n],
            ),
        )  # fmt: skip
        to += pitch


@inlined
def add_products(out: Floats, sums: Floats, a: tuple[Floats, ...], b: tuple[Floats, ...]) -> None:
    """Write the sum of nine products of equally long arrays, and add it to the sums.

    The compiler vectorizes this form.
    """
    a0, a1, a2, a3, a4, a5, a6, a7, a8 = a
    b0, b1, b2, b3, b4, b5, b6, b7, b8 = b
    for j in range(len(out)):
        after = (
            a0[j] * b0[j] + a1[j] * b1[j] + a2[j] * b2[j]
            + a3[j] * b3[j] + a4[j] * b4[j] + a5[j] * b5[j]
            + a6[j] * b6[j] + a7[j] * b7[j] + a8[j] * b8[j]
        )  # fmt: skip
        sums[j] += after
        out[j] = after


@part
def receive_with_drift(
    pitch: int,
    frame: Frame,
    chances: Floats,
    scratch: Floats,
    component: Floats,
    cells: Floats,
    direction: int,
) -> None:
    """Do what `receive_by_table` does, where each person has an own drift.

    From each cell the drift goes to one neighbour, with the probability that `copy_to_frame` has
    multiplied in. A step to any neighbour has this probability times the map's at the neighbour,
    over `DRIFT_WEIGHT`: what a cell receives is its own probability on the map times the sum of
    the nine cells around it, and what has drifted to it.

    Args:
        frame: Of the component.
        chances: (S,) of `MotionTables`, the map.
        scratch: Of `predict`; it begins with what `copy_to_frame` wrote.
        component: The cells, out.
        cells: (S,), the sums of the class, in and out.
        direction: Of the drift, by number.
    """
    runs, n = inner_runs(pitch, frame)
    width, count = frame.width, frame.rows * frame.width
    drifted, rows = scratch[: count + 2], scratch[count + 2 :]
    add_three(rows[:count], drifted[:count], drifted[1 : count + 1], drifted[2 : count + 2])
    offset = (direction // 3 - 1) * width + direction % 3 - 1
    to = (frame.north + 1) * pitch + frame.west
    for k in range(runs):
        a, b, c, d = k * n, k * n + width, k * n + 2 * width, k * n + width + 1 - offset
        add_windows(
            component[a : a + n], cells[to : to + n], chances[to : to + n], rows[a : a + n],
            rows[b : b + n], rows[c : c + n], drifted[d : d + n],
        )  # fmt: skip
        to += pitch


@inlined
def add_three(out: Floats, a: Floats, b: Floats, c: Floats) -> None:
    """Write sums of three."""
    for j in range(len(out)):
        out[j] = a[j] + b[j] + c[j]


@inlined
def add_windows(
    out: Floats,
    sums: Floats,
    chances: Floats,
    above: Floats,
    here: Floats,
    below: Floats,
    drifted: Floats,
) -> None:
    """Write what cells receive, see `receive_with_drift`, and add it to the sums.

    Args:
        out: The cells.
        sums: Of the class, in these cells.
        chances: The map in these cells.
        above: What drifts from the three cells in the row before each.
        here: The same in its row.
        below: The same in the next row.
        drifted: What has drifted to each cell.
    """
    for j in range(len(out)):
        after = chances[j] * (above[j] + here[j] + below[j]) * PER_DRIFT + drifted[j]
        sums[j] += after
        out[j] = after


@part
def keep_in_area(
    constants: Constants,
    area: NDArray[np.bool_] | None,
    frame: Frame,
    box: Ints,
    drifted: Floats,
    direction: int,
    component: Floats,
    cells: Floats,
) -> None:
    """Move what has drifted out of the grid or the area to the cells where the persons stay.

    Args:
        area: (R, C) bool, the searched cells; None for all.
        frame: Of the component.
        box: Before the step; its place in memory is that after the step.
        drifted: Of `copy_to_frame`, what drifts from each cell.
        direction: Of the drift, by number.
        component: The cells, in and out.
        cells: (S,), the sums of the class, in and out.
    """
    columns, rows = constants.columns, constants.rows
    dx, dy = direction % 3 - 1, direction // 3 - 1
    west, east = max(box[WEST] - MARGIN, 0), min(box[EAST] - MARGIN, columns)
    for y in range(max(box[NORTH] - MARGIN, 0), min(box[SOUTH] - MARGIN, rows)):
        first, end = west, east
        if area is None and 0 <= y + dy < rows:
            # In this row the drift leaves the grid from the column at one edge at most.
            first = max(west, columns - 1 if dx > 0 else 0)
            end = min(east, first + 1 if dx > 0 else -dx)
        for x in range(first, end):
            col, row = x + MARGIN, y + MARGIN
            here = drifted[(row - frame.north) * frame.width + col - frame.west + 1]
            if here <= 0.0:
                continue
            step = step_of_drift(constants, area, x, y, direction)
            if step != direction:
                i = index_of(constants, x, y)
                for way, moved in ((direction, -here), (step, here)):
                    component[stored_at(box, col + way % 3 - 1, row + way // 3 - 1)] += moved
                    cells[i + offset_of(constants, way)] += moved


@part
def shrink(
    pitch: int, component: Floats, box: Ints, first: int, cells: Floats, negligible: float
) -> None:
    """Take from a box the columns at its ends whose cells are all negligible, and empty them.

    Args:
        component: (S,), the cells of the box, in and out.
        first: `WEST` for columns, `NORTH` for rows.
        cells: (S,), the sums of the class, in and out.
        negligible: Probability up to which a cell is.
    """
    for end in (first, first + 1):
        while box[WEST] < box[EAST] and box[NORTH] < box[SOUTH]:
            if not is_end_negligible(component, box, end, negligible):
                break
            empty_end(pitch, component, box, end, cells)


@inlined
def is_end_negligible(component: Floats, box: Ints, end: int, negligible: float) -> bool:
    """Return whether all cells of the column or row at an end of a box are."""
    first, width = stored_at(box, box[WEST], box[NORTH]), box[EAST] - box[WEST]
    if end <= EAST:
        first += 0 if end == WEST else width - 1
        for row in range(box[SOUTH] - box[NORTH]):
            if component[first + row * box[PITCH]] > negligible:
                return False
        return True
    first += 0 if end == NORTH else (box[SOUTH] - 1 - box[NORTH]) * box[PITCH]
    return is_negligible(component[first : first + width], negligible)


@inlined
def is_negligible(cells: Floats, negligible: float) -> bool:
    """Return whether all cells are."""
    others = 0
    for i in range(len(cells)):
        others += cells[i] > negligible
    return others == 0


@part
def empty_end(pitch: int, component: Floats, box: Ints, end: int, cells: Floats) -> None:
    """Empty the column or row of cells at one end of a box, and take it from the box."""
    west, east, north, south = box[WEST], box[EAST], box[NORTH], box[SOUTH]
    if end == WEST:
        east = west + 1
    elif end == EAST:
        west = east - 1
    elif end == NORTH:
        south = north + 1
    else:
        north = south - 1
    for y in range(north, south):
        for x in range(west, east):
            at = stored_at(box, x, y)
            cells[y * pitch + x] -= component[at]
            component[at] = 0.0
    box[end] += 1 if end in (WEST, NORTH) else -1

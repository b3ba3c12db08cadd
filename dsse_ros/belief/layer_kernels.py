# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled motion of a belief: the layers whose persons move, and the sums of the cells.

Arguments are those of `belief_kernels`. A layer is (S S,) of a `Mass`, its box (`BOX`,) and the
cells of its class (S S,). Loops over slices of equal lengths are in functions without other
arguments, which the compiler vectorizes.

Many beliefs do not fit the caches. So the step reads and writes only the box of a layer, which is
contiguous in memory, and requests the next layer before it moves one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.belief.belief_kernels import (
    BOTTOM,
    FIRST_COLUMN,
    FIRST_ROW,
    LEFT,
    MARGIN,
    NEGLIGIBLE,
    PITCH,
    RIGHT,
    ROW,
    TOP,
    complete,
    index_of,
    offset_of,
    step_of_drift,
    stored_at,
)
from dsse_ros.compiled.jit import inlined, kernel, part
from dsse_ros.compiled.prefetching import prefetch
from dsse_ros.targets.drawn_cell import DRIFT_WEIGHT
from dsse_ros.targets.motion import STAND_STILL, STEPS

PER_DRIFT = 1.0 / DRIFT_WEIGHT
VECTOR = 4
"""Columns of a frame are a multiple of this: loops over them need no remainder."""
LINE = 8
"""Cells in a cache line."""


class Frame(NamedTuple):
    """The cells that a layer's step can reach, and those around them, which stay empty.

    A copy of its cells is contiguous, and after the step the layer is its inner rows.

    Attributes:
        left, top: The first column and row of cells.
        width, rows: Number of columns, a multiple of `VECTOR` or S, and of rows of cells.
    """

    left: int
    top: int
    width: int
    rows: int


@part
def frame_of(side, box):
    """Return the frame of a layer before its step."""
    left, right = max(box[LEFT] - 2, 0), min(box[RIGHT] + 2, side)
    top, bottom = max(box[TOP] - 2, 0), min(box[BOTTOM] + 2, side)
    width = -(-(right - left) // VECTOR) * VECTOR
    if 2 * width > side:
        return Frame(0, top, side, bottom - top)
    return Frame(min(left, side - width), top, width, bottom - top)


@part
def inner_runs(side, frame):
    """Return in how many runs of cells the inner rows of a frame are, and their length."""
    rows = frame.rows - 2
    if frame.width == side:
        return 1, rows * side
    return rows, frame.width


@inlined
def is_negligible(cells, negligible):
    """Return whether all cells are."""
    others = 0
    for i in range(len(cells)):
        others += cells[i] > negligible
    return others == 0


@inlined
def is_end_negligible(layer, box, end, negligible):
    """Return whether all cells of the column or row at an end of a box are."""
    first, width = stored_at(box, box[LEFT], box[TOP]), box[RIGHT] - box[LEFT]
    if end <= RIGHT:
        first += 0 if end == LEFT else width - 1
        for row in range(box[BOTTOM] - box[TOP]):
            if layer[first + row * box[PITCH]] > negligible:
                return False
        return True
    first += 0 if end == TOP else (box[BOTTOM] - 1 - box[TOP]) * box[PITCH]
    return is_negligible(layer[first : first + width], negligible)


@part
def empty_end(side, layer, box, end, cells):
    """Empty the column or row of cells at an end of a box, and take it from the box."""
    left, right, top, bottom = box[LEFT], box[RIGHT], box[TOP], box[BOTTOM]
    if end == LEFT:
        right = left + 1
    elif end == RIGHT:
        left = right - 1
    elif end == TOP:
        bottom = top + 1
    else:
        top = bottom - 1
    for y in range(top, bottom):
        for x in range(left, right):
            at = stored_at(box, x, y)
            cells[y * side + x] -= layer[at]
            layer[at] = 0.0
    box[end] += 1 if end in (LEFT, TOP) else -1


@part
def shrink(side, layer, box, first, cells, negligible):
    """Empty the negligible columns of cells at the ends of a box, or rows if `first` is `TOP`."""
    for end in (first, first + 1):
        while box[LEFT] < box[RIGHT] and box[TOP] < box[BOTTOM]:
            if not is_end_negligible(layer, box, end, negligible):
                break
            empty_end(side, layer, box, end, cells)


@inlined
def copy_but_negligible(layer, negligible, known, sums, before):
    """Copy cells, the negligible ones as empty, and take all from their sums.

    Returns:
        How many of those copied the table lacks.
    """
    unknown = 0
    for i in range(len(layer)):
        here = layer[i] if layer[i] > negligible else 0.0
        sums[i] -= layer[i]
        before[i] = here
        unknown += (here > 0.0) & (known[i] < 0.0)
    return unknown


@inlined
def weigh_but_negligible(layer, negligible, sums, added, drifted):
    """As `copy_but_negligible`, but write what drifts from each cell."""
    unknown = 0
    for i in range(len(layer)):
        here = layer[i] if layer[i] > negligible else 0.0
        sums[i] -= layer[i]
        drifted[i] = here * added[i]
        unknown += (here > 0.0) & (added[i] < 0.0)
    return unknown


@part
def complete_table(constants, sea, step, layer, negligible, box, row):
    """Complete the table of a step for the cells of a layer but the negligible ones."""
    side = constants.grid_size + 2 * MARGIN
    for y in range(box[TOP], box[BOTTOM]):
        for x in range(box[LEFT], box[RIGHT]):
            if layer[stored_at(box, x, y)] > negligible:
                complete(constants, sea, step, y * side + x, row)


class Runs(NamedTuple):
    """The cells of a layer's box as runs of cells that are contiguous in the layer and its frame.

    Attributes:
        number, length: Number of runs, and of cells in each.
        stored, pitch: Where the first run is in the layer, and the cells to the next one.
        cell: The column of a belief of the first cell; the next run is S cells further.
        framed: Where the first run is in the frame; the next one is a frame's width further.
    """

    number: int
    length: int
    stored: int
    pitch: int
    cell: int
    framed: int


@part
def box_runs(side, frame, box):
    """Return the runs of a layer's box."""
    rows, left = box[BOTTOM] - box[TOP], box[LEFT]
    number, length = rows, box[RIGHT] - left
    if frame.width == side and box[PITCH] == side:
        number, length, left = 1, rows * side, 0
    return Runs(
        number, length, stored_at(box, left, box[TOP]), box[PITCH], box[TOP] * side + left,
        (box[TOP] - frame.top) * frame.width + left - frame.left,
    )  # fmt: skip


@part
def fill(constants, frame, runs, layer, negligible, table, before, cells):
    """Write the cells of a layer's frame, with own drifts what drifts from each, to `before`.

    Negligible ones count as empty; all are taken from `cells`. One empty cell precedes the frame in
    `before`, and one follows it.

    Returns:
        How many of those not negligible the table lacks.
    """
    n, unknown, end = runs.length, 0, frame.rows * frame.width + 2
    i, j, k = runs.stored, runs.cell, runs.framed + 1
    if runs.number == 1:
        before[:k] = before[k + n : end] = 0.0
    else:
        before[:end] = 0.0
    for _ in range(runs.number):
        here, out = layer[i : i + n], before[k : k + n]
        sums = cells[j : j + n]
        if constants.own_drift:
            unknown += weigh_but_negligible(here, negligible, sums, table[STEPS, j : j + n], out)
        else:
            unknown += copy_but_negligible(here, negligible, table[0, j : j + n], sums, out)
        i += runs.pitch
        j += constants.grid_size + 2 * MARGIN
        k += frame.width
    return unknown


@inlined
def add_products(out, sums, a, b):
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
def gather(side, frame, before, table, layer, cells):
    """Write the probability that steps from all cells bring to a frame's inner rows."""
    runs, n = inner_runs(side, frame)
    width, to = frame.width, (frame.top + 1) * side + frame.left
    for k in range(runs):
        # The cells where the steps 8 to 0 start.
        a, d, g = 1 + k * n, 1 + k * n + width, 1 + k * n + 2 * width
        p, q, r = to - side, to, to + side
        add_products(
            layer[k * n : k * n + n],
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
        to += side


@inlined
def add_three(out, a, b, c):
    """Write sums of three."""
    for j in range(len(out)):
        out[j] = a[j] + b[j] + c[j]


@inlined
def add_windows(out, sums, chances, above, here, below, drifted):
    """Write what steps to the window and those of the drift bring, and add it to the sums.

    Args:
        out: The cells.
        sums: Of the cells.
        chances: Probabilities of the cells, see `Steps`.
        above: What drifts from three cells around each cell's neighbour in the row before.
        here: The same of the cell.
        below: The same of its neighbour in the next row.
        drifted: What drifts to each cell.
    """
    for j in range(len(out)):
        after = chances[j] * (above[j] + here[j] + below[j]) * PER_DRIFT + drifted[j]
        sums[j] += after
        out[j] = after


@part
def draw_together(side, frame, chances, scratch, layer, cells, direction):
    """Write the probability that steps to the window and the drift bring to a frame's inner rows.

    Args:
        side: S.
        frame: Of the layer.
        chances: Of `Steps`.
        scratch: Of `predict`; it begins with what drifts from each cell. What steps to a neighbour
            is this times the neighbour's probability, over `DRIFT_WEIGHT`.
        layer: The cells, out.
        cells: Their sums, in and out.
        direction: Of the drift.
    """
    runs, n = inner_runs(side, frame)
    width, count = frame.width, frame.rows * frame.width
    drifted, rows = scratch[: count + 2], scratch[count + 2 :]
    add_three(rows[:count], drifted[:count], drifted[1 : count + 1], drifted[2 : count + 2])
    offset = (direction // 3 - 1) * width + direction % 3 - 1
    to = (frame.top + 1) * side + frame.left
    for k in range(runs):
        a, b, c, d = k * n, k * n + width, k * n + 2 * width, k * n + width + 1 - offset
        add_windows(
            layer[a : a + n], cells[to : to + n], chances[to : to + n], rows[a : a + n],
            rows[b : b + n], rows[c : c + n], drifted[d : d + n],
        )  # fmt: skip
        to += side


@part
def keep_within(constants, area, frame, box, drifted, direction, layer, cells):
    """Move what the drift brought out of the area to the cells where the persons stay.

    Arguments are as in `draw_together`; `box` is that of the layer before and its memory now.
    """
    last, dx, dy = constants.grid_size - 1, direction % 3 - 1, direction // 3 - 1
    left, right = max(box[LEFT] - MARGIN, 0), min(box[RIGHT] - MARGIN, last + 1)
    for y in range(max(box[TOP] - MARGIN, 0), min(box[BOTTOM] - MARGIN, last + 1)):
        first, end = left, right
        if area is None and 0 <= y + dy <= last:
            # Only from the column at the edge that the drift goes to.
            first = max(left, last if dx > 0 else 0)
            end = min(right, first + 1 if dx > 0 else -dx)
        for x in range(first, end):
            col, row = x + MARGIN, y + MARGIN
            here = drifted[(row - frame.top) * frame.width + col - frame.left + 1]
            if here <= 0.0:
                continue
            step = step_of_drift(constants, area, x, y, direction)
            if step != direction:
                i = index_of(constants, x, y)
                for way, moved in ((direction, -here), (step, here)):
                    layer[stored_at(box, col + way % 3 - 1, row + way // 3 - 1)] += moved
                    cells[i + offset_of(constants, way)] += moved


@part
def move_layer(constants, sea, mass, k, step, scratch):
    """Advance layer k of a belief by the persons' step, see `predict`."""
    drifts, side = len(step.directions), constants.grid_size + 2 * MARGIN
    layer, box, cells = mass.layers[k], mass.boxes[k], mass.cells[k // drifts]
    direction, negligible = step.directions[k % drifts], NEGLIGIBLE * mass.totals[k // drifts]
    # Negligible cells count as empty from here on.
    shrink(side, layer, box, LEFT, cells, negligible)
    frame = frame_of(side, box)
    runs = box_runs(side, frame, box)
    if fill(constants, frame, runs, layer, negligible, step.tables, scratch, cells) > 0:
        complete_table(constants, sea, step, layer, negligible, box, scratch[-ROW:])
        # They are taken already.
        others = scratch[len(layer) + 2 :]
        fill(constants, frame, runs, layer, negligible, step.tables, scratch, others)
    # The outermost rows of a frame are empty.
    box[FIRST_COLUMN], box[FIRST_ROW], box[PITCH] = frame.left, frame.top + 1, frame.width
    if constants.own_drift:
        draw_together(side, frame, step.chances, scratch, layer, cells, direction)
        keep_within(constants, sea.area, frame, box, scratch, direction, layer, cells)
    else:
        gather(side, frame, scratch, step.tables, layer, cells)
    # The outermost cells are always empty, and all off the grid unless persons walk there.
    low = 1 if constants.person_walks_blind else MARGIN
    for end in (LEFT, TOP):
        box[end], box[end + 1] = max(box[end] - 1, low), min(box[end + 1] + 1, side - low)
    # Now its cells are in the caches; before the next move they no longer are.
    shrink(side, layer, box, TOP, cells, negligible)


def new_scratch(cells: int) -> NDArray[np.float64]:
    """Return memory for `predict` with S S cells."""
    return np.empty(2 * cells + 2 + ROW)


@part
def request(layer, box):
    """Request the memory of a layer before and after its step."""
    rows, columns = box[BOTTOM] - box[TOP] + 2, box[RIGHT] - box[LEFT] + 2 + VECTOR
    for i in range(0, rows * columns, LINE):
        prefetch(layer, i)


@kernel
def predict(constants, sea, mass, step, scratch):
    """Advance a belief by the persons' step; its totals do not change.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        sea: Of the scenario.
        mass: The belief.
        step: One of `Steps`; its table is completed.
        scratch: Of `new_scratch`.
    """
    moving = -1
    for k in range(len(mass.layers)):
        direction, box = step.directions[k % len(step.directions)], mass.boxes[k]
        if direction == STAND_STILL or box[LEFT] >= box[RIGHT] or box[TOP] >= box[BOTTOM]:
            continue
        if moving >= 0:
            request(mass.layers[k], box)
            move_layer(constants[0], sea, mass, moving, step, scratch)
        moving = k
    if moving >= 0:
        move_layer(constants[0], sea, mass, moving, step, scratch)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled belief in cells: its components, what a search leaves of them, and their motion.

A component is the probability of the persons of one detection class and one drift, and a `Mass` has
all of them. Columns are the cells row by row, S = G + 2 `MARGIN` along a side. Persons who walked
off the grid (`person_walks_blind`) are in its margin.

Only what changes is touched: a search takes from one column, and a step moves the components of the
drifts that have accumulated a cell. A component is empty outside its box, and its memory begins
with the cells of the box, because the components of many beliefs do not fit the caches: `predict`
reads and writes only boxes, and requests the next component before it moves one. No other module
knows boxes; `predict_plainly` is the same step without them. A belief is
scaled where it is read, see `search_outcomes.weigh_classes`.

Loops over slices of equal lengths are in functions without other arguments, which the compiler
vectorizes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import compiled, expanded, inlined, kernel, part
from dsse_ros.base.compiled.prefetching import prefetch
from dsse_ros.search.belief.motion_kernels import (
    MARGIN,
    NEGLIGIBLE,
    ROW,
    Flags,
    Floats,
    Ints,
    MotionTables,
    complete,
    index_of,
    move_probabilities,
    offset_of,
    step_of_drift,
)
from dsse_ros.search.step.constants import Constants
from dsse_ros.world.targets.drawn_cell import DRIFT_WEIGHT
from dsse_ros.world.targets.motion import STAND_STILL, STEPS
from dsse_ros.world.targets.sea_map import Sea, is_inside

NOTHING_LEFT = 1e-9
"""Remaining share of a belief below which it is impossible: nobody can be in its cells."""

FADED = 1 / 128
"""Total below which a class is scaled up and summed again: the rounding errors of its sums do not
decrease with it."""

LEFT, RIGHT, TOP, BOTTOM, FIRST_COLUMN, FIRST_ROW, PITCH = range(7)
"""Numbers of a box: the first column of cells and the last one plus one, and the same of the rows;
then its place in memory: the column and row of the first cell there, and the cells from one row to
the next."""
BOX = 7


class Mass(NamedTuple):
    """The probability of where the persons are, up to a factor for each detection class.

    Attributes:
        components: (C K, S S) float64, row m K + k is for the persons of detection class m and
            drift k; see `unpack`. Of an ensemble, (C, M), the weights of its particles, see
            `particle_kernels`.
        boxes: (C K, `BOX`) int64, the box of each component; of an ensemble, (0, `BOX`).
        cells: (C, S S) float64, the sums of the components of each class; of an ensemble, (0, 0).
        totals: (C,) float64, the sum of each class.
    """

    components: NDArray[np.float64]
    boxes: NDArray[np.int64]
    cells: NDArray[np.float64]
    totals: NDArray[np.float64]

    def copy(self) -> Mass:
        """Return an independent copy."""
        return Mass(
            self.components.copy(), self.boxes.copy(), self.cells.copy(), self.totals.copy()
        )


@expanded
def mass_of(masses: Mass, b: int) -> Mass:
    """Return the mass of world b; those of B worlds have a first axis more."""
    return Mass(masses.components[b], masses.boxes[b], masses.cells[b], masses.totals[b])


@inlined
def stored_at(box: Ints, col: int, row: int) -> int:
    """Return where in memory a component has a cell of its box."""
    return (row - box[FIRST_ROW]) * box[PITCH] + col - box[FIRST_COLUMN]


@inlined
def place_of(mass: Mass, k: int, col: int, row: int) -> int:
    """Return where component k has a cell, -1 if the cell is outside its box."""
    box = mass.boxes[k]
    if box[LEFT] <= col < box[RIGHT] and box[TOP] <= row < box[BOTTOM]:
        return stored_at(box, col, row)
    return -1


@inlined
def copy_rows(rows: NDArray[Any], to: NDArray[Any]) -> None:
    """Copy an array with two axes."""
    for k in range(len(rows)):
        for i in range(rows.shape[1]):
            to[k, i] = rows[k, i]


@part
def copy_mass(start: Mass, mass: Mass) -> None:
    """Copy a belief."""
    for k in range(len(start.components)):
        first, end = 0, start.components.shape[1]
        if len(start.boxes):
            box = start.boxes[k]
            first = (box[TOP] - box[FIRST_ROW]) * box[PITCH]
            end = first + (box[BOTTOM] - box[TOP]) * box[PITCH]
        for i in range(first, end):
            mass.components[k, i] = start.components[k, i]
    copy_rows(start.boxes, mass.boxes)
    copy_rows(start.cells, mass.cells)
    for m in range(len(start.totals)):
        mass.totals[m] = start.totals[m]


def sum_up(mass: Mass, side: int) -> None:
    """Compute the rest of a mass from components that have all cells in memory."""
    components, boxes, cells, totals = mass
    cells[:] = components.reshape(*cells.shape[:1], -1, cells.shape[1]).sum(axis=1)
    totals[:] = cells.sum(axis=1)
    inhabited = components.reshape(-1, side, side) > 0.0
    for axis, first in ((1, LEFT), (2, TOP)):
        lines = np.asarray(inhabited.any(axis=axis))
        boxes[:, first] = lines.argmax(axis=1)
        boxes[:, first + 1] = side - lines[:, ::-1].argmax(axis=1)
    boxes[:, FIRST_COLUMN] = boxes[:, FIRST_ROW] = 0
    boxes[:, PITCH] = side


@kernel
def unpack(mass: Mass, side: int, out: Floats) -> None:
    """Write the components cell by cell, (C K, S S) float64."""
    out[:] = 0.0
    for k in range(len(out)):
        box = mass.boxes[k]
        for y in range(box[TOP], box[BOTTOM]):
            at, i = stored_at(box, box[LEFT], y), y * side + box[LEFT]
            for x in range(box[RIGHT] - box[LEFT]):
                out[k, i + x] = mass.components[k, at + x]


@part
def remove(
    constants: Constants, mass: Mass, apart: Flags, alone: Floats, mixed: Floats, x: int, y: int
) -> float:
    """Take a share of each class from a cell of the grid, without its totals; return what it took.

    On a CPU this is the one place where a cell is multiplied by 1 - POD.

    Args:
        apart: (K,) of `MotionTables`.
        alone: (C,) float64, the share taken of the components that are apart.
        mixed: (C,) float64, that of the others.
    """
    drifts, removed = len(apart), 0.0
    for m in range(len(mixed)):
        left = 0.0
        for k in range(drifts):
            at = place_of(mass, m * drifts + k, x + MARGIN, y + MARGIN)
            if at >= 0:
                component = mass.components[m * drifts + k]
                taken = component[at] * (alone[m] if apart[k] else mixed[m])
                component[at] -= taken
                removed += taken
                left += component[at]
        mass.cells[m, index_of(constants, x, y)] = left
    return removed


@part
def apply_failed_search(
    constants: Constants, mass: Mass, apart: Flags, pods: Floats, x: int, y: int
) -> float:
    """Update a belief with a failed search, without its totals; return the probability removed.

    Args:
        apart: (K,) of `MotionTables`.
    """
    if not is_inside(constants.grid_size, x, y):
        return 0.0
    return remove(constants, mass, apart, pods, pods, x, y)


@part
def total_of(shares: Floats) -> float:
    """Return a sum, from eight partial sums, because each addition waits for the previous one."""
    a = b = c = d = e = f = g = h = 0.0
    eights = len(shares) // 8
    for j in range(0, 8 * eights, 8):
        a += shares[j]
        b += shares[j + 1]
        c += shares[j + 2]
        d += shares[j + 3]
        e += shares[j + 4]
        f += shares[j + 5]
        g += shares[j + 6]
        h += shares[j + 7]
    for j in range(8 * eights, len(shares)):
        a += shares[j]
    return ((a + b) + (c + d)) + ((e + f) + (g + h))


@part
def scale_class(mass: Mass, side: int, m: int, factor: float) -> None:
    """Scale the components of class m, and sum them again."""
    cells = mass.cells[m]
    drifts = len(mass.components) // len(mass.totals)
    cells[:] = 0.0
    for k in range(m * drifts, (m + 1) * drifts):
        component, box = mass.components[k], mass.boxes[k]
        for y in range(box[TOP], box[BOTTOM]):
            at, i = stored_at(box, box[LEFT], y), y * side + box[LEFT]
            for x in range(box[RIGHT] - box[LEFT]):
                component[at + x] *= factor
                cells[i + x] += component[at + x]
    mass.totals[m] = total_of(cells)


@part
def put_box(box: Ints, side: int, first: int, end: int) -> None:
    """Write the box of a square of cells in a component that has all cells in memory."""
    box[LEFT] = box[TOP] = first
    box[RIGHT] = box[BOTTOM] = end
    box[FIRST_COLUMN] = box[FIRST_ROW] = 0
    box[PITCH] = side


@part
def close_classes(constants: Constants, mass: Mass, chances: Floats) -> None:
    """Sum up a belief after searches.

    If no probability is left of a class, because its persons cannot be anywhere by the rules, the
    class restarts from the present map, `chances` of `MotionTables`.
    """
    side, drifts = constants.grid_size + 2 * MARGIN, len(mass.components) // len(mass.totals)
    for m in range(len(mass.totals)):
        total, left = total_of(mass.cells[m]), NOTHING_LEFT * mass.totals[m]
        mass.totals[m] = total
        if total < left:
            for k in range(m * drifts, (m + 1) * drifts):
                put_box(mass.boxes[k], side, MARGIN, side - MARGIN)
                for i in range(len(chances)):
                    mass.components[k, i] = chances[i]
            total = drifts * total_of(chances)
            scale_class(mass, side, m, 1.0 / total if total > 0.0 else 0.0)
        elif total > 0.0 and not FADED < total < 1.0 / FADED:
            scale_class(mass, side, m, 1.0 / total)


@part
def detectable(constants: Constants, mass: Mass, pods: Floats, x: int, y: int) -> float:
    """Return what `apply_failed_search` would remove, 0 off the grid."""
    if not is_inside(constants.grid_size, x, y):
        return 0.0
    i, share = index_of(constants, x, y), 0.0
    for m in range(len(pods)):
        share += mass.cells[m, i] * pods[m]
    return max(share, 0.0)


PER_DRIFT = 1.0 / DRIFT_WEIGHT
VECTOR = 4
"""Columns of a frame are a multiple of this: loops over them need no remainder."""
LINE = 8
"""Cells in a cache line."""


class Frame(NamedTuple):
    """The cells that a component's step can reach, and those around them, which stay empty.

    A copy of its cells is contiguous, and after the step the component is its inner rows.

    Attributes:
        left, top: The first column and row of cells.
        width, rows: Number of columns, a multiple of `VECTOR` or S, and of rows of cells.
    """

    left: int
    top: int
    width: int
    rows: int


@part
def frame_of(side: int, box: Ints) -> Frame:
    """Return the frame of a component before its step."""
    left, right = max(box[LEFT] - 2, 0), min(box[RIGHT] + 2, side)
    top, bottom = max(box[TOP] - 2, 0), min(box[BOTTOM] + 2, side)
    width = -(-(right - left) // VECTOR) * VECTOR
    if 2 * width > side:
        return Frame(0, top, side, bottom - top)
    return Frame(min(left, side - width), top, width, bottom - top)


@part
def inner_runs(side: int, frame: Frame) -> tuple[int, int]:
    """Return in how many runs of cells the inner rows of a frame are, and their length."""
    rows = frame.rows - 2
    if frame.width == side:
        return 1, rows * side
    return rows, frame.width


@inlined
def is_negligible(cells: Floats, negligible: float) -> bool:
    """Return whether all cells are."""
    others = 0
    for i in range(len(cells)):
        others += cells[i] > negligible
    return others == 0


@inlined
def is_end_negligible(component: Floats, box: Ints, end: int, negligible: float) -> bool:
    """Return whether all cells of the column or row at an end of a box are."""
    first, width = stored_at(box, box[LEFT], box[TOP]), box[RIGHT] - box[LEFT]
    if end <= RIGHT:
        first += 0 if end == LEFT else width - 1
        for row in range(box[BOTTOM] - box[TOP]):
            if component[first + row * box[PITCH]] > negligible:
                return False
        return True
    first += 0 if end == TOP else (box[BOTTOM] - 1 - box[TOP]) * box[PITCH]
    return is_negligible(component[first : first + width], negligible)


@part
def empty_end(side: int, component: Floats, box: Ints, end: int, cells: Floats) -> None:
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
            cells[y * side + x] -= component[at]
            component[at] = 0.0
    box[end] += 1 if end in (LEFT, TOP) else -1


@part
def shrink(
    side: int, component: Floats, box: Ints, first: int, cells: Floats, negligible: float
) -> None:
    """Empty the negligible columns of cells at the ends of a box, or rows if `first` is `TOP`."""
    for end in (first, first + 1):
        while box[LEFT] < box[RIGHT] and box[TOP] < box[BOTTOM]:
            if not is_end_negligible(component, box, end, negligible):
                break
            empty_end(side, component, box, end, cells)


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
    side = constants.grid_size + 2 * MARGIN
    for y in range(box[TOP], box[BOTTOM]):
        for x in range(box[LEFT], box[RIGHT]):
            if component[stored_at(box, x, y)] > negligible:
                complete(constants, sea, tables, y * side + x, row)


class Runs(NamedTuple):
    """The cells of a component's box as runs that are contiguous in the component and its frame.

    Attributes:
        number, length: Number of runs, and of cells in each.
        stored, pitch: Where the first run is in the component, and the cells to the next one.
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
def box_runs(side: int, frame: Frame, box: Ints) -> Runs:
    """Return the runs of a component's box."""
    rows, left = box[BOTTOM] - box[TOP], box[LEFT]
    number, length = rows, box[RIGHT] - left
    if frame.width == side and box[PITCH] == side:
        number, length, left = 1, rows * side, 0
    return Runs(
        number, length, stored_at(box, left, box[TOP]), box[PITCH], box[TOP] * side + left,
        (box[TOP] - frame.top) * frame.width + left - frame.left,
    )  # fmt: skip


@part
def fill(
    constants: Constants,
    frame: Frame,
    runs: Runs,
    component: Floats,
    negligible: float,
    table: Floats,
    before: Floats,
    cells: Floats,
) -> int:
    """Write the cells of a component's frame, with own drifts what drifts from each, to `before`.

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
        here, out = component[i : i + n], before[k : k + n]
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
def gather(
    side: int, frame: Frame, before: Floats, table: Floats, component: Floats, cells: Floats
) -> None:
    """Write the probability that steps from all cells bring to a frame's inner rows."""
    runs, n = inner_runs(side, frame)
    width, to = frame.width, (frame.top + 1) * side + frame.left
    for k in range(runs):
        # The cells where the steps 8 to 0 start.
        a, d, g = 1 + k * n, 1 + k * n + width, 1 + k * n + 2 * width
        p, q, r = to - side, to, to + side
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
        to += side


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
    """Write what steps to the window and those of the drift bring, and add it to the sums.

    Args:
        out: The cells.
        sums: Of the cells.
        chances: Probabilities of the cells, see `MotionTables`.
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
def draw_together(
    side: int,
    frame: Frame,
    chances: Floats,
    scratch: Floats,
    component: Floats,
    cells: Floats,
    direction: int,
) -> None:
    """Write the probability that steps to the window and the drift bring to a frame's inner rows.

    Args:
        frame: Of the component.
        chances: Of `MotionTables`.
        scratch: Of `predict`; it begins with what drifts from each cell. What steps to a neighbour
            is this times the neighbour's probability, over `DRIFT_WEIGHT`.
        component: The cells, out.
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
            component[a : a + n], cells[to : to + n], chances[to : to + n], rows[a : a + n],
            rows[b : b + n], rows[c : c + n], drifted[d : d + n],
        )  # fmt: skip
        to += side


@part
def keep_within(
    constants: Constants,
    area: NDArray[np.bool_] | None,
    frame: Frame,
    box: Ints,
    drifted: Floats,
    direction: int,
    component: Floats,
    cells: Floats,
) -> None:
    """Move what the drift brought out of the area to the cells where the persons stay.

    Arguments are as in `draw_together`; `box` is that of the component before and its memory now.
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
                    component[stored_at(box, col + way % 3 - 1, row + way // 3 - 1)] += moved
                    cells[i + offset_of(constants, way)] += moved


@part
def move_component(
    constants: Constants, sea: Sea, mass: Mass, k: int, tables: MotionTables, scratch: Floats
) -> None:
    """Advance component k of a belief by the persons' step, see `predict`."""
    drifts, side = len(tables.directions), constants.grid_size + 2 * MARGIN
    component, box, cells = mass.components[k], mass.boxes[k], mass.cells[k // drifts]
    direction, negligible = tables.directions[k % drifts], NEGLIGIBLE * mass.totals[k // drifts]
    # Negligible cells count as empty from here on.
    shrink(side, component, box, LEFT, cells, negligible)
    frame = frame_of(side, box)
    runs = box_runs(side, frame, box)
    if fill(constants, frame, runs, component, negligible, tables.tables, scratch, cells) > 0:
        complete_table(constants, sea, tables, component, negligible, box, scratch[-ROW:])
        # They are taken already.
        others = scratch[len(component) + 2 :]
        fill(constants, frame, runs, component, negligible, tables.tables, scratch, others)
    # The outermost rows of a frame are empty.
    box[FIRST_COLUMN], box[FIRST_ROW], box[PITCH] = frame.left, frame.top + 1, frame.width
    if constants.own_drift:
        draw_together(side, frame, tables.chances, scratch, component, cells, direction)
        keep_within(constants, sea.area, frame, box, scratch, direction, component, cells)
    else:
        gather(side, frame, scratch, tables.tables, component, cells)
    # The outermost cells are always empty, and all off the grid unless persons walk there.
    low = 1 if constants.person_walks_blind else MARGIN
    for end in (LEFT, TOP):
        box[end], box[end + 1] = max(box[end] - 1, low), min(box[end + 1] + 1, side - low)
    # Now its cells are in the caches; before the next move they no longer are.
    shrink(side, component, box, TOP, cells, negligible)


def new_scratch(cells: int) -> NDArray[np.float64]:
    """Return memory for `predict` with S S cells."""
    return np.empty(2 * cells + 2 + ROW)


@part
def request(component: Floats, box: Ints) -> None:
    """Request the memory of a component before and after its step."""
    rows, columns = box[BOTTOM] - box[TOP] + 2, box[RIGHT] - box[LEFT] + 2 + VECTOR
    for i in range(0, rows * columns, LINE):
        prefetch(component, i)


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
        if direction == STAND_STILL or box[LEFT] >= box[RIGHT] or box[TOP] >= box[BOTTOM]:
            continue
        if moving >= 0:
            request(mass.components[k], box)
            move_component(constants[0], sea, mass, moving, tables, scratch)
        moving = k
    if moving >= 0:
        move_component(constants[0], sea, mass, moving, tables, scratch)


@compiled()
def predict_plainly(
    constants: NDArray[np.void], sea: Sea, density: Floats, tables: MotionTables, after: Floats
) -> None:
    """Advance components cell by cell: what `predict` does, without boxes.

    Args:
        density: (C K, S S) float64, as from `unpack`.
        after: (C K, S S) float64 out.
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

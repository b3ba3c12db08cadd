# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled belief in cells: its components, and what a search leaves of them.

A component is the probability of the persons of one detection class and one drift, and a `Mass` has
all of them. Columns are the S cells of the grid and its `MARGIN`, row by row. Persons who walked
off the grid (`person_walks_blind`) are in its margin.

Only what changes is touched: a search takes from one column, and a step of the persons moves the
components of the drifts that have accumulated a cell, see `component_motion`. A component is empty
outside its box, and its memory begins with the cells of the box, because the components of many
beliefs do not fit the caches. Only these two modules know boxes. A belief is scaled where it is
read, see `search_outcomes.weigh_classes`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import expanded, inlined, kernel, part
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.belief.motion_kernels import MARGIN, Flags, Floats, Ints, index_of, pitch_of
from dsse_ros.search.step.constants import Constants
from dsse_ros.world.targets.sea_map import grid_of, is_inside

NOTHING_LEFT = 1e-9
"""Remaining share of a belief below which it is impossible: nobody can be in its cells."""

FADED = 1 / 128
"""Total below which a class is scaled up and summed again: the rounding errors of its sums do not
decrease with it."""

WEST, EAST, NORTH, SOUTH, FIRST_COLUMN, FIRST_ROW, PITCH = range(7)
"""Numbers of a box: its first column of cells and its last one plus one, and the same of its rows;
then where they are in memory: the column and row of the first cell there, and the cells from one
row to the next."""
BOX = 7


class Mass(NamedTuple):
    """The probability of where the persons are, up to a factor for each detection class.

    Attributes:
        components: (C K, S) float64, row m K + k is for the persons of detection class m and
            drift k; see `unpack`. Of an ensemble, (C, M), the weights of its particles, see
            `particle_kernels`.
        boxes: (C K, `BOX`) int64, the box of each component; of an ensemble, (0, `BOX`).
        cells: (C, S) float64, the sums of the components of each class; of an ensemble, (0, 0).
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
    if box[WEST] <= col < box[EAST] and box[NORTH] <= row < box[SOUTH]:
        return stored_at(box, col, row)
    return -1


@part
def put_box(constants: Constants, box: Ints) -> None:
    """Write the box of the whole grid in a component that has all cells in memory."""
    box[WEST] = box[NORTH] = MARGIN
    box[EAST], box[SOUTH] = MARGIN + constants.columns, MARGIN + constants.rows
    box[FIRST_COLUMN] = box[FIRST_ROW] = 0
    box[PITCH] = pitch_of(constants)


def sum_up(mass: Mass, padded: GridShape) -> None:
    """Compute the rest of a mass from components that have all cells in memory."""
    components, boxes, cells, totals = mass
    cells[:] = components.reshape(*cells.shape[:1], -1, cells.shape[1]).sum(axis=1)
    totals[:] = cells.sum(axis=1)
    inhabited = components.reshape(-1, *padded.matrix) > 0.0
    for axis, first, size in ((1, WEST, padded.columns), (2, NORTH, padded.rows)):
        lines = np.asarray(inhabited.any(axis=axis))
        boxes[:, first] = lines.argmax(axis=1)
        boxes[:, first + 1] = size - lines[:, ::-1].argmax(axis=1)
    boxes[:, FIRST_COLUMN] = boxes[:, FIRST_ROW] = 0
    boxes[:, PITCH] = padded.columns


@kernel
def unpack(mass: Mass, pitch: int, out: Floats) -> None:
    """Write the components cell by cell, (C K, S) float64; `pitch` is that of `pitch_of`."""
    out[:] = 0.0
    for k in range(len(out)):
        box = mass.boxes[k]
        for y in range(box[NORTH], box[SOUTH]):
            at, i = stored_at(box, box[WEST], y), y * pitch + box[WEST]
            for x in range(box[EAST] - box[WEST]):
                out[k, i + x] = mass.components[k, at + x]


@part
def copy_mass(start: Mass, mass: Mass) -> None:
    """Copy a belief."""
    for k in range(len(start.components)):
        first, end = 0, start.components.shape[1]
        if len(start.boxes):
            box = start.boxes[k]
            first = (box[NORTH] - box[FIRST_ROW]) * box[PITCH]
            end = first + (box[SOUTH] - box[NORTH]) * box[PITCH]
        for i in range(first, end):
            mass.components[k, i] = start.components[k, i]
    copy_rows(start.boxes, mass.boxes)
    copy_rows(start.cells, mass.cells)
    for m in range(len(start.totals)):
        mass.totals[m] = start.totals[m]


@inlined
def copy_rows(rows: NDArray[Any], to: NDArray[Any]) -> None:
    """Copy an array with two axes."""
    for k in range(len(rows)):
        for i in range(rows.shape[1]):
            to[k, i] = rows[k, i]


@part
def apply_failed_search(
    constants: Constants, mass: Mass, apart: Flags, pods: Floats, x: int, y: int
) -> float:
    """Update a belief with a failed search, without its totals; return the probability removed.

    Args:
        apart: (K,) of `MotionTables`.
    """
    if not is_inside(grid_of(constants), x, y):
        return 0.0
    return remove(constants, mass, apart, pods, pods, x, y)


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
def detectable(constants: Constants, mass: Mass, pods: Floats, x: int, y: int) -> float:
    """Return what `apply_failed_search` would remove, 0 off the grid."""
    if not is_inside(grid_of(constants), x, y):
        return 0.0
    i, share = index_of(constants, x, y), 0.0
    for m in range(len(pods)):
        share += mass.cells[m, i] * pods[m]
    return max(share, 0.0)


@part
def close_classes(constants: Constants, mass: Mass, chances: Floats) -> None:
    """Sum up a belief after searches.

    If no probability is left of a class, because its persons cannot be anywhere by the rules, the
    class restarts from the present map, `chances` of `MotionTables`.
    """
    pitch, drifts = pitch_of(constants), len(mass.components) // len(mass.totals)
    for m in range(len(mass.totals)):
        total, left = total_of(mass.cells[m]), NOTHING_LEFT * mass.totals[m]
        mass.totals[m] = total
        if total < left:
            for k in range(m * drifts, (m + 1) * drifts):
                put_box(constants, mass.boxes[k])
                for i in range(len(chances)):
                    mass.components[k, i] = chances[i]
            total = drifts * total_of(chances)
            scale_class(mass, pitch, m, 1.0 / total if total > 0.0 else 0.0)
        elif total > 0.0 and not FADED < total < 1.0 / FADED:
            scale_class(mass, pitch, m, 1.0 / total)


@part
def scale_class(mass: Mass, pitch: int, m: int, factor: float) -> None:
    """Scale the components of class m, and sum them again."""
    cells = mass.cells[m]
    drifts = len(mass.components) // len(mass.totals)
    cells[:] = 0.0
    for k in range(m * drifts, (m + 1) * drifts):
        component, box = mass.components[k], mass.boxes[k]
        for y in range(box[NORTH], box[SOUTH]):
            at, i = stored_at(box, box[WEST], y), y * pitch + box[WEST]
            for x in range(box[EAST] - box[WEST]):
                component[at + x] *= factor
                cells[i + x] += component[at + x]
    mass.totals[m] = total_of(cells)


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

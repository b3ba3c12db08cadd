# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled filter: motion of a belief about persons, and its update after a failed search.

A belief is a `Mass`. Columns are the cells row by row, S = G + 2 `MARGIN` along a side. Persons who
walked off the grid (`person_walks_blind`) are in its margin. Steps to neighbours are numbered as in
`targets.motion`.

Only what changes is touched: a search takes from one column, a step moves the layers of the drifts
that have accumulated a cell, within their boxes, and the sums follow. A belief is scaled where it
is read, see `search_outcomes.weigh_classes`.

The sea is that of `sea_map`; the motions in `targets` set the probabilities of a person's steps.
See `search_outcomes` for searches for several persons, and `follow_kernels` for the step of many
beliefs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.compiled.jit import expanded, inlined, kernel, part
from dsse_ros.targets.motion import CHANCES, NO_STEP, SCRATCH, STAND_STILL, STEPS
from dsse_ros.targets.person_kernels import DRIFT_RANGES, gathered_step, own_drift, step_chances
from dsse_ros.targets.sea_map import cell_probability, is_inside, map_step, start_map, step_within

MARGIN = 3
"""Cells around the grid: one from which a person can return, one from which it cannot, and one that
is always empty, so that every cell has neighbours."""

ROW = CHANCES + STEPS + SCRATCH
"""Length of the array that `transition` writes to."""

NEGLIGIBLE = 1e-13
"""Probability below which a cell counts as empty. Otherwise a belief in a few cells would spread
over the whole grid, and every cell would need a table."""


NOTHING_LEFT = 1e-9
"""Remaining share of a belief below which it is impossible: nobody can be in its cells."""

FADED = 1 / 128
"""Total below which a class is scaled up and summed again: the rounding errors of its sums do not
decrease with it."""


LEFT, RIGHT, TOP, BOTTOM, FIRST_COLUMN, FIRST_ROW, PITCH = range(7)
"""Numbers of a layer's box: the first column of cells and the last one plus one, and the same of
the rows, outside of which the layer is empty; then its place in memory: the column and row of the
first cell there, and the cells from one row to the next."""
BOX = 7


class Mass(NamedTuple):
    """The probability of where the persons are, up to a factor for each detection class.

    Attributes:
        layers: (C K, S S) float64, row m K + k is for the persons of detection class m and drift k;
            see `unpack`. Of an ensemble, (C, M), the weights of its particles, see
            `particle_kernels`.
        boxes: (C K, `BOX`) int64, the box of each layer: its row of `layers` begins with that part
            of the cells; of an ensemble, (0, `BOX`).
        cells: (C, S S) float64, the sums of the layers of each class; of an ensemble, (0, 0).
        totals: (C,) float64, the sum of each class.
    """

    layers: NDArray[np.float64]
    boxes: NDArray[np.int64]
    cells: NDArray[np.float64]
    totals: NDArray[np.float64]

    def copy(self) -> Mass:
        """Return an independent copy."""
        return Mass(self.layers.copy(), self.boxes.copy(), self.cells.copy(), self.totals.copy())


@expanded
def mass_of(masses, b):
    """Return the mass of world b; those of B worlds have a first axis more."""
    return Mass(masses.layers[b], masses.boxes[b], masses.cells[b], masses.totals[b])


class Steps(NamedTuple):
    """What sets the persons' steps in R steps of the sea, or in one: then there is no axis R.

    Attributes:
        chances: (R, S S) float64, the probability of every cell that persons look at.
        tables: (R, `CHANCES`, S S) float64, the probabilities of the steps from each cell, see
            `complete`; the first and the last row are negative in columns not known yet.
        directions: (R, K) int64, the direction of each drift, see `PersonMotion`, or `STAND_STILL`.
        apart: (R, K) bool, the drifts whose persons are still where they were scattered to, each in
            a separate cell.
    """

    chances: NDArray[np.float64]
    tables: NDArray[np.float64]
    directions: NDArray[np.int64]
    apart: NDArray[np.bool_]

    def at(self, slot: int) -> Steps:
        """Return one of the R steps."""
        return Steps(*(array[slot] for array in self))


@expanded
def step_at(steps, slot):
    """Return one of the R steps."""
    return Steps(steps.chances[slot], steps.tables[slot], steps.directions[slot], steps.apart[slot])


@part
def index_of(constants, x, y):
    """Return the column of a belief for a cell."""
    return (y + MARGIN) * (constants.grid_size + 2 * MARGIN) + x + MARGIN


@part
def offset_of(constants, step):
    """Return the offset from the column of a cell to that of its neighbour."""
    return (step // 3 - 1) * (constants.grid_size + 2 * MARGIN) + step % 3 - 1


@part
def is_lost(constants, i):
    """Return whether a column is so far off the grid that no window reaches it."""
    side = constants.grid_size + 2 * MARGIN
    x, y = i % side, i // side
    return x <= 1 or y <= 1 or x >= side - 2 or y >= side - 2


@kernel
def start_sea(constants, worlds, drifts):
    """Set map and drifts to their state in `recipe.start_world` before the first step.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        worlds: (1,) of `kernels.WORLDS`, with start and vector set; its generator is not used.
        drifts: (K,) of `motion.PERSONS` out. If each person has an own drift, these are the middles
            of K equally probable ranges of its angle.
    """
    world, count = worlds[0], len(drifts)
    start_map(constants[0], world)
    for k in range(count):
        drifts[k].remainder_x = drifts[k].remainder_y = 0.0
        if constants[0].own_drift:
            place = DRIFT_RANGES * (k + 0.5) / count
            number = int(place)
            drifts[k].drift_x, drifts[k].drift_y = own_drift(
                constants[0], world, number, place - number
            )


@kernel
def forecast_step(constants, worlds, sea, circle, drifts, step, still):
    """Advance map and drifts by one step and write the values that set the persons' next step.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        worlds: (1,) of `kernels.WORLDS`.
        sea: Of the world.
        circle: (G + 1,) int64 scratch.
        drifts: (K,) of `motion.PERSONS`.
        step: Out, but for its table.
        still: (K,) bool in and out, the drifts that are apart before the next step.
    """
    world, grid_size = worlds[0], constants[0].grid_size
    if not constants[0].person_first:
        map_step(constants[0], world, sea, circle)
    step.chances[:] = 0.0
    for y in range(grid_size):
        for x in range(grid_size):
            probability = cell_probability(constants[0], world, sea.gauss, sea.area, x, y)
            step.chances[index_of(constants[0], x, y)] = probability
    for k in range(len(drifts)):
        step.directions[k] = gathered_step(drifts[k]) if constants[0].own_drift else NO_STEP
        step.apart[k] = still[k]
        still[k] = still[k] and step.directions[k] == STAND_STILL
    if constants[0].person_first:
        map_step(constants[0], world, sea, circle)


@part
def step_of_drift(constants, area, x, y, direction):
    """Return the step from a cell of the grid whose probability a drift in this direction raises.

    It stays within the grid and the area.
    """
    dx, dy = direction % 3 - 1, direction // 3 - 1
    to_x, to_y = step_within(area, constants.grid_size, x, y, dx, dy)
    return 3 * (to_y - y + 1) + to_x - x + 1


@part
def transition(constants, sea, chances, i, row):
    """Write the table column of a cell, from the persons' motion.

    Args:
        constants: The constants.
        sea: Of the scenario.
        chances: (S S,) of `Steps`.
        i: Column of the cell.
        row: (`ROW`,) float64; the first `CHANCES` are out, the rest is scratch.
    """
    if is_lost(constants, i):
        row[:CHANCES] = 0.0
        row[NO_STEP] = 1.0
        return
    side = constants.grid_size + 2 * MARGIN
    window, scratch = row[CHANCES : CHANCES + STEPS], row[CHANCES + STEPS :]
    for step in range(STEPS):
        window[step] = chances[i + offset_of(constants, step)]
    x, y = i % side - MARGIN, i // side - MARGIN
    step_chances(constants, sea, x, y, window, row[:CHANCES], scratch)


@part
def complete(constants, sea, step, i, row):
    """Compute the column of a cell in the table of a step, if it is not known yet.

    Args:
        constants: The constants.
        sea: Of the scenario.
        step: One of `Steps`.
        i: Column of the cell.
        row: (`ROW`,) float64 scratch.
    """
    if step.tables[0, i] < 0.0:
        transition(constants, sea, step.chances, i, row)
        for k in range(CHANCES):
            step.tables[k, i] = row[k]


@part
def look_up(constants, sea, step, i, direction, row):
    """Write the probabilities (9,) of the steps from a cell.

    Args:
        constants: The constants.
        sea: Of the scenario.
        step: One of `Steps`.
        i: Column of the cell.
        direction: One of the step's directions.
        row: (`ROW`,) float64 out, the rest is scratch.
    """
    complete(constants, sea, step, i, row)
    table = step.tables
    for number in range(STEPS):
        row[number] = table[number, i]
    if table[STEPS, i] > 0.0:
        side = constants.grid_size + 2 * MARGIN
        x, y = i % side - MARGIN, i // side - MARGIN
        row[step_of_drift(constants, sea.area, x, y, direction)] += table[STEPS, i]


@inlined
def is_in_box(box, col, row):
    """Return whether a layer's box has a cell."""
    return box[LEFT] <= col < box[RIGHT] and box[TOP] <= row < box[BOTTOM]


@inlined
def stored_at(box, col, row):
    """Return where in a layer a cell of its box is."""
    return (row - box[FIRST_ROW]) * box[PITCH] + col - box[FIRST_COLUMN]


@kernel
def unpack(mass, side, out):
    """Write the layers cell by cell, (C K, S S) float64."""
    out[:] = 0.0
    for k in range(len(out)):
        box = mass.boxes[k]
        for y in range(box[TOP], box[BOTTOM]):
            at, i = stored_at(box, box[LEFT], y), y * side + box[LEFT]
            for x in range(box[RIGHT] - box[LEFT]):
                out[k, i + x] = mass.layers[k, at + x]


@part
def search(constants, mass, pods, x, y):
    """Update a belief with a failed search of a cell, but for its totals; return what it removed.

    Args:
        constants: The constants.
        mass: The belief.
        pods: (C,) float64, probability of detection.
        x: Column of the cell; a search off the grid has no effect.
        y: Row of the cell.
    """
    if not is_inside(constants.grid_size, x, y):
        return 0.0
    layers, i = mass.layers, index_of(constants, x, y)
    drifts, taken = len(layers) // len(pods), 0.0
    for m in range(len(pods)):
        left = 0.0
        for k in range(m * drifts, (m + 1) * drifts):
            box = mass.boxes[k]
            if not is_in_box(box, x + MARGIN, y + MARGIN):
                continue
            at = stored_at(box, x + MARGIN, y + MARGIN)
            part_taken = layers[k, at] * pods[m]
            layers[k, at] -= part_taken
            taken += part_taken
            left += layers[k, at]
        mass.cells[m, i] = left
    return taken


@part
def total_of(shares):
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
def scale_class(mass, side, m, factor):
    """Scale the layers of class m, and sum them again."""
    cells = mass.cells[m]
    drifts = len(mass.layers) // len(mass.totals)
    cells[:] = 0.0
    for k in range(m * drifts, (m + 1) * drifts):
        layer, box = mass.layers[k], mass.boxes[k]
        for y in range(box[TOP], box[BOTTOM]):
            at, i = stored_at(box, box[LEFT], y), y * side + box[LEFT]
            for x in range(box[RIGHT] - box[LEFT]):
                layer[at + x] *= factor
                cells[i + x] += layer[at + x]
    mass.totals[m] = total_of(cells)


@part
def put_box(box, side, first, end):
    """Write the box of a square of cells in a layer that has all cells of the grid in memory."""
    box[LEFT] = box[TOP] = first
    box[RIGHT] = box[BOTTOM] = end
    box[FIRST_COLUMN] = box[FIRST_ROW] = 0
    box[PITCH] = side


@part
def close_classes(constants, mass, chances):
    """Sum up a belief after searches.

    If no probability is left of a class, because its persons cannot be anywhere by the rules, the
    class restarts from the present map, `chances` of `Steps`.
    """
    side, drifts = constants.grid_size + 2 * MARGIN, len(mass.layers) // len(mass.totals)
    for m in range(len(mass.totals)):
        total, left = total_of(mass.cells[m]), NOTHING_LEFT * mass.totals[m]
        mass.totals[m] = total
        if total < left:
            for k in range(m * drifts, (m + 1) * drifts):
                put_box(mass.boxes[k], side, MARGIN, side - MARGIN)
                for i in range(len(chances)):
                    mass.layers[k, i] = chances[i]
            total = drifts * total_of(chances)
            scale_class(mass, side, m, 1.0 / total if total > 0.0 else 0.0)
        elif total > 0.0 and not FADED < total < 1.0 / FADED:
            scale_class(mass, side, m, 1.0 / total)


@part
def detectable(constants, mass, pods, x, y):
    """Return what `search` would remove, 0 off the grid."""
    if not is_inside(constants.grid_size, x, y):
        return 0.0
    i, share = index_of(constants, x, y), 0.0
    for m in range(len(pods)):
        share += mass.cells[m, i] * pods[m]
    return max(share, 0.0)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled motion of the persons of a belief in cells: the probabilities of their moves.

Columns are those of `component_kernels`, and moves to neighbours are numbered as in
`targets.motion`. The sea is that of `sea_map`; the motions in `targets` set the probabilities.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import expanded, inlined, kernel, part
from dsse_ros.search.step.constants import Constants
from dsse_ros.world.targets.motion import CHANCES, NO_STEP, SCRATCH, STAND_STILL, STEPS
from dsse_ros.world.targets.person_kernels import (
    DRIFT_RANGES,
    gathered_step,
    own_drift,
    step_chances,
)
from dsse_ros.world.targets.sea_map import (
    Sea,
    cell_probability,
    grid_of,
    map_step,
    start_map,
    step_within,
)

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Flags: TypeAlias = NDArray[np.bool_]


MARGIN = 3
"""Cells around the grid: one from which a person can return, one from which it cannot, and one that
is always empty, so that every cell has neighbours."""

ROW = CHANCES + STEPS + SCRATCH
"""Length of the array that `transition` writes to."""

NEGLIGIBLE = 1e-13
"""Probability below which a cell counts as empty. Otherwise a belief in a few cells would spread
over the whole grid, and every cell would need a table."""


class MotionTables(NamedTuple):
    """What sets the persons' moves in R steps of the sea, or in one: then there is no axis R.

    Attributes:
        chances: (R, S) float64, the probability of every cell that persons look at.
        tables: (R, `CHANCES`, S) float64, the probabilities of the steps from each cell, see
            `complete`; the first and the last row are negative in columns not known yet.
        directions: (R, K) int64, the direction of each drift, see `PersonMotion`, or `STAND_STILL`.
        apart: (R, K) bool, the drifts whose persons are still where they were scattered to, each in
            a separate cell.
    """

    chances: NDArray[np.float64]
    tables: NDArray[np.float64]
    directions: NDArray[np.int64]
    apart: NDArray[np.bool_]

    def at(self, slot: int) -> MotionTables:
        """Return one of the R steps."""
        return MotionTables(*(array[slot] for array in self))


@expanded
def tables_at(tables: MotionTables, slot: int) -> MotionTables:
    """Return one of the R steps."""
    return MotionTables(
        tables.chances[slot], tables.tables[slot], tables.directions[slot], tables.apart[slot]
    )


@inlined
def pitch_of(constants: Constants) -> int:
    """Return the columns of a belief from one row of cells to the next."""
    return constants.columns + 2 * MARGIN


@part
def index_of(constants: Constants, x: int, y: int) -> int:
    """Return the column of a belief for a cell."""
    return (y + MARGIN) * pitch_of(constants) + x + MARGIN


@part
def offset_of(constants: Constants, step: int) -> int:
    """Return the offset from the column of a cell to that of its neighbour."""
    return (step // 3 - 1) * pitch_of(constants) + step % 3 - 1


@part
def is_lost(constants: Constants, i: int) -> bool:
    """Return whether a column is so far off the grid that no window reaches it."""
    width, height = pitch_of(constants), constants.rows + 2 * MARGIN
    x, y = i % width, i // width
    return x <= 1 or y <= 1 or x >= width - 2 or y >= height - 2


@kernel
def start_sea(
    constants: NDArray[np.void], worlds: NDArray[np.void], drifts: NDArray[np.void]
) -> None:
    """Set map and drifts to their state in `recipe.start_world` before the first step.

    Args:
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
def forecast_step(
    constants: NDArray[np.void],
    worlds: NDArray[np.void],
    sea: Sea,
    circle: Ints,
    drifts: NDArray[np.void],
    tables: MotionTables,
    still: Flags,
) -> None:
    """Advance map and drifts by one step and write the values that set the persons' next step.

    Args:
        circle: (L + 1,) int64 scratch.
        drifts: (K,) of `motion.PERSONS`.
        tables: Out, but for the table.
        still: (K,) bool in and out, the drifts that are apart before the next step.
    """
    world = worlds[0]
    if not constants[0].person_first:
        map_step(constants[0], world, sea, circle)
    tables.chances[:] = 0.0
    for y in range(constants[0].rows):
        for x in range(constants[0].columns):
            probability = cell_probability(constants[0], world, sea.gauss, sea.area, x, y)
            tables.chances[index_of(constants[0], x, y)] = probability
    for k in range(len(drifts)):
        tables.directions[k] = gathered_step(drifts[k]) if constants[0].own_drift else NO_STEP
        tables.apart[k] = still[k]
        still[k] = still[k] and tables.directions[k] == STAND_STILL
    if constants[0].person_first:
        map_step(constants[0], world, sea, circle)


@part
def step_of_drift(
    constants: Constants, area: NDArray[np.bool_] | None, x: int, y: int, direction: int
) -> int:
    """Return the step from a cell of the grid whose probability a drift in this direction raises.

    It stays within the grid and the area.
    """
    dx, dy = direction % 3 - 1, direction // 3 - 1
    to_x, to_y = step_within(area, grid_of(constants), x, y, dx, dy)
    return 3 * (to_y - y + 1) + to_x - x + 1


@part
def transition(constants: Constants, sea: Sea, chances: Floats, i: int, row: Floats) -> None:
    """Write the table column of a cell, from the persons' motion.

    Args:
        chances: (S,) of `MotionTables`.
        row: (`ROW`,) float64; the first `CHANCES` are out, the rest is scratch.
    """
    if is_lost(constants, i):
        row[:CHANCES] = 0.0
        row[NO_STEP] = 1.0
        return
    width = pitch_of(constants)
    window, scratch = row[CHANCES : CHANCES + STEPS], row[CHANCES + STEPS :]
    for step in range(STEPS):
        window[step] = chances[i + offset_of(constants, step)]
    x, y = i % width - MARGIN, i // width - MARGIN
    step_chances(constants, sea, x, y, window, row[:CHANCES], scratch)


@part
def complete(constants: Constants, sea: Sea, tables: MotionTables, i: int, row: Floats) -> None:
    """Compute the column of a cell in the table of a step, if it is not known yet."""
    if tables.tables[0, i] < 0.0:
        transition(constants, sea, tables.chances, i, row)
        for k in range(CHANCES):
            tables.tables[k, i] = row[k]


@part
def move_probabilities(
    constants: Constants, sea: Sea, tables: MotionTables, i: int, direction: int, row: Floats
) -> None:
    """Write the probabilities (9,) of the steps from a cell.

    Args:
        direction: One of those of the tables.
        row: (`ROW`,) float64 out, the rest is scratch.
    """
    complete(constants, sea, tables, i, row)
    table = tables.tables
    for number in range(STEPS):
        row[number] = table[number, i]
    if table[STEPS, i] > 0.0:
        width = pitch_of(constants)
        x, y = i % width - MARGIN, i // width - MARGIN
        row[step_of_drift(constants, sea.area, x, y, direction)] += table[STEPS, i]

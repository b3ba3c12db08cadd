# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Moves, looks and finds of plans, compiled, for the planner `belief`.

A plan is a path of H + 1 cells, the present one first; staying in a cell searches it. Where moves
take longer than a step, a plan is late: it looks in later steps, and no longer after the horizon.
Cells are the columns of a belief, see `component_kernels`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.breadth_first import ROUNDING
from dsse_ros.base.compiled.jit import compiled, inlined, kernel
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.belief.motion_kernels import MARGIN, Floats, Ints

UNIT = 1 << 40
"""A find, where finds are added as integers: such sums do not depend on their order."""


class Moves(NamedTuple):
    """The moves of a kind of drone and their looks.

    Attributes:
        steps: (A,) int64, what each move adds to a cell's number; 0, the search, comes first.
        able: (A,) bool, whether the kind can do the move.
        starts: (A + 1,) int64, the looks of move a are starts[a] .. starts[a + 1] - 1.
        offsets: (L, 2) int64, (dx, dy) of a look from the cell that the move leads to.
        pods: (L, P) float64, POD of each person.
        nearness: (R, C) float64, worth of a scenario left at the end by its distance, [y, x], with
            the R rows and C columns of the grid and its margins.
        positions: (S,) int64, position of each cell, see `around`.
        around: (4 S,) int64, `nearness` of two cells in `UNIT`, by the difference of their
            positions from the middle: a subtraction instead of divisions.
        extra: (A,) float64, steps that each move takes until it looks, beyond the first.
        rest: (A,) float64, steps that it takes after that.
    """

    steps: NDArray[np.int64]
    able: NDArray[np.bool_]
    starts: NDArray[np.int64]
    offsets: NDArray[np.int64]
    pods: NDArray[np.float64]
    nearness: NDArray[np.float64]
    positions: NDArray[np.int64]
    around: NDArray[np.int64]
    extra: NDArray[np.float64]
    rest: NDArray[np.float64]


class Scenarios(NamedTuple):
    """Futures of the persons, sorted by cell.

    Attributes:
        persons: (M,) as in `Futures`.
        draws: (H, M) float64 in [0, 1), which a POD must exceed to detect the person of a future;
            (0, 0) if every look has a POD of 1.
        starts: (H, S + 1) int64, as in `Futures`.
        members: (H, M) uint32, as in `Futures`.
        ends: (M,) int64, the last cells.
    """

    persons: NDArray[np.int64]
    draws: NDArray[np.float64]
    starts: NDArray[np.int64]
    members: NDArray[np.uint32]
    ends: NDArray[np.int64]


@inlined
def step_at(h: int, late: float) -> int:
    """Return the step in which a look is made that is late for step h: the one in which it ends."""
    return h + int(math.ceil(late - ROUNDING))


@kernel
def column_at(padded: GridShape, cell: int, dx: int, dy: int) -> int:
    """Return the cell at this offset from another one, -1 off the grid.

    Args:
        padded: The grid with its margins.
        cell: The other cell.
        dx: Columns to the east.
        dy: Rows to the south.
    """
    x, y = cell % padded.columns + dx, cell // padded.columns + dy
    if min(x, y) < MARGIN or x >= padded.columns - MARGIN or y >= padded.rows - MARGIN:
        return -1
    return y * padded.columns + x


@inlined
def cell_seen(moves: Moves, cell: int, look: int) -> int:
    """Return the cell that a look sees from a cell, -1 off the grid."""
    dx, dy = moves.offsets[look, 0], moves.offsets[look, 1]
    if dx == 0 and dy == 0:
        # Most looks, without the divisions.
        return cell
    rows, columns = moves.nearness.shape
    return column_at(GridShape(columns, rows), cell, dx, dy)


@inlined
def seen_from(moves: Moves, here: int, there: int) -> int:
    """Return the worth of a scenario at the end at a position to a drone at another one, int64."""
    rows, columns = moves.nearness.shape
    return moves.around[2 * rows * columns + columns + here - there]


@inlined
def detects(moves: Moves, scenarios: Scenarios, h: int, look: int, s: int) -> bool:
    """Return whether a look at step h detects the person of scenario s in the cell it sees."""
    draws = scenarios.draws
    return len(draws) == 0 or draws[h, s] < moves.pods[look, scenarios.persons[s]]


@kernel
def move_between(steps: Ints, cell: int, after: int) -> int:
    """Return the number of the move from a cell to another one."""
    for a in range(len(steps)):
        if cell + steps[a] == after:
            return a
    return -1


class PlannedFleet(NamedTuple):
    """The moves and looks of drones, by kind.

    Attributes:
        kinds: (N,) int64, kinds of the drones.
        steps: (A,) int64, as in `Moves`.
        starts: (K, A + 1) int64, as in `Moves`.
        offsets: (L, 2) int64, as in `Moves`.
        extra: (K, A) float64, as in `Moves`.
        rest: (K, A) float64, as in `Moves`.
        padded: The grid with its margins.
    """

    kinds: NDArray[np.int64]
    steps: NDArray[np.int64]
    starts: NDArray[np.int64]
    offsets: NDArray[np.int64]
    extra: NDArray[np.float64]
    rest: NDArray[np.float64]
    padded: GridShape


@inlined
def add_looks(
    fleet: PlannedFleet, kind: int, move: int, cell: int, step: int, looks: Ints, count: int
) -> int:
    """Write the looks of a move into a cell behind the `count` looks there; return their number."""
    for k in range(fleet.starts[kind, move], fleet.starts[kind, move + 1]):
        there = column_at(fleet.padded, cell, fleet.offsets[k, 0], fleet.offsets[k, 1])
        if there >= 0:
            looks[0, count], looks[1, count], looks[2, count] = step, there, k
            count += 1
    return count


@compiled()
def looks_of_plans(
    fleet: PlannedFleet, paths: Ints, lengths: Ints, starts: Ints, looks: Ints
) -> None:
    """Write the looks of plans of all drones, step by step and in a step drone by drone.

    Args:
        paths: (V, N, H + 1) int64.
        lengths: (V, N) int64, number of planned steps of each path.
        starts: (V + 1,) int64 out: the looks of plan v are starts[v] .. starts[v + 1] - 1.
        looks: (3, Q) int64 out: the step of each look, its column and its number.
    """
    count, plans, drones, last = 0, paths.shape[0], paths.shape[1], paths.shape[2] - 1
    starts[0] = 0
    for v in range(plans):
        done, late = np.zeros(drones, np.int64), np.zeros(drones)
        for step, n in np.ndindex(last, drones):
            kind, path = int(fleet.kinds[n]), paths[v, n]
            for h in range(done[n], lengths[v, n]):
                a = move_between(fleet.steps, path[h], path[h + 1])
                if a >= 0:
                    if step_at(h, late[n] + fleet.extra[kind, a]) > step:
                        break
                    late[n] += fleet.extra[kind, a] + fleet.rest[kind, a]
                    count = add_looks(fleet, kind, a, path[h + 1], step, looks, count)
                done[n] = h + 1
        starts[v + 1] = count


@kernel
def credit_plan(
    moves: Moves, scenarios: Scenarios, path: Ints, length: int, gamma: float, credit: Floats
) -> None:
    """Write the credit of a plan for each scenario: gamma ** (step of its first find), or 0.

    Args:
        path: (H + 1,) int64.
        credit: (M,) float64 out.
    """
    credit[:] = 0.0
    worth, late, horizon = 1.0, 0.0, len(scenarios.starts)
    for h in range(length):
        a = move_between(moves.steps, path[h], path[h + 1])
        if a >= 0:
            step = step_at(h, late + moves.extra[a])
            if step >= horizon:
                break
            found = worth * gamma ** (late + moves.extra[a])
            late += moves.extra[a] + moves.rest[a]
            for k in range(moves.starts[a], moves.starts[a + 1]):
                there = cell_seen(moves, path[h + 1], k)
                if there < 0:
                    continue
                for j in range(scenarios.starts[step, there], scenarios.starts[step, there + 1]):
                    s = scenarios.members[step, j]
                    if detects(moves, scenarios, step, k, s):
                        credit[s] = max(credit[s], found)
        worth *= gamma


@kernel
def worth_of_left(left: Floats, nearness: Floats, ends: Ints, worth: Floats) -> None:
    """Write the worth of the persons left at the end to a drone in a cell.

    Args:
        left: (V, S) float64, the probability that a person is in a cell and was not found.
        nearness: (R, C) float64, as in `Moves`.
        ends: (V,) int64, the drone's cells.
        worth: (V,) float64 out.
    """
    rows, columns = nearness.shape
    for v in range(len(ends)):
        worth[v] = 0.0
        for y in range(rows):
            near = nearness[abs(y - ends[v] // columns)]
            for x in range(columns):
                if left[v, y * columns + x] > 0.0:
                    worth[v] += left[v, y * columns + x] * near[abs(x - ends[v] % columns)]

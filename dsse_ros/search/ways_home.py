# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Routes home for drones whose batteries run down.

A drone's home is its start cell. Its route has the fewest moves, and few turns; against the wind a
move may take more than one step.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dsse_ros.scenario.actions import DIAGONAL, ActionSet, Cell
from dsse_ros.scenario.fields import FieldError
from dsse_ros.step.fault_kernels import ROUNDING

MAX_BYTES = 1 << 30
"""Limit for the routes of all drones together."""


class WaysHome(NamedTuple):
    """The route of each drone to its home from each cell.

    Attributes:
        steps: (N, G, G) int32, steps of the route from cell [y, x]; -1 if there is none.
        actions: (N, G, G) int8, first action of the route; -1 at home.
    """

    steps: NDArray[np.int32]
    actions: NDArray[np.int8]


def ways_home(
    actions: ActionSet,
    area: NDArray[np.bool_] | None,
    grid_size: int,
    homes: Sequence[Cell],
    paces: Sequence[Sequence[float]],
) -> WaysHome:
    """Return the routes home.

    Args:
        actions: The actions of the rules.
        area: (G, G) bool [row, col], the searched cells; None for all.
        grid_size: G.
        homes: Cell (col, row) of each drone's home.
        paces: For each drone and action, the share of the move that one step covers; 0 for an
            action that the drone cannot do.

    Raises:
        FieldError: If the tables would be too large, or a straight move is missing.
    """
    if 5 * len(homes) * grid_size**2 > MAX_BYTES:
        raise FieldError(
            f"battery_move is not allowed with {len(homes)} drones on {grid_size} x {grid_size} "
            "cells; fewer of either"
        )
    try:
        actions.with_moves()
    except ValueError as error:
        raise FieldError(f"battery_move: {error}") from None
    steps = np.empty((len(homes), grid_size, grid_size), np.int32)
    numbers = np.empty(steps.shape, np.int8)
    water = np.ones((grid_size, grid_size), np.bool_) if area is None else area.copy()
    for home, of_drone, of_home, next_actions in zip(homes, paces, steps, numbers, strict=True):
        table = np.array(_moves(actions, of_drone), np.int64)
        _find_ways(water, table, np.array(of_drone, float), *home, of_home, next_actions)
    return WaysHome(steps, numbers)


def _moves(actions: ActionSet, paces: Sequence[float]) -> list[tuple[int, int, int]]:
    """Return the moves (dx, dy, number) that a drone can do; each has its opposite."""
    moves = [
        (dx, dy, number)
        for number, (dx, dy) in enumerate(actions.moves)
        if (dx, dy) != (0, 0) and paces[number] > 0
    ]
    diagonal = actions.diagonal and sum(0 not in move[:2] for move in moves) == len(DIAGONAL)
    return [move for move in moves if diagonal or 0 in move[:2]]


@njit(cache=True, nogil=True)
def _find_ways(
    water: Any, moves: Any, paces: Any, col: int, row: int, steps: Any, actions: Any
) -> None:
    """Write the routes to one home, from the home outwards.

    Args:
        water: (G, G) bool [row, col], cells that moves may enter.
        moves: (M, 3) int64, steps (dx, dy) and numbers of the moves; each has its opposite.
        paces: For each action, the share of the move that one step covers.
        col: Column of the home.
        row: Its row.
        steps: (G, G) int32 out.
        actions: (G, G) int8 out.
    """
    size = len(water)
    steps[:] = -1
    actions[:] = -1
    queue = np.empty((size * size, 2), np.int64)
    # Moves in one direction from a cell, and the steps from where they end: progress against the
    # wind carries over from move to move, but not around a turn.
    run = np.zeros((size, size), np.int64)
    after_run = np.zeros((size, size), np.int64)
    queue[0, 0], queue[0, 1] = col, row
    steps[row, col] = 0
    first, last = 0, 1
    while first < last:
        x, y = queue[first]
        first += 1
        for k in range(len(moves)):
            from_x, from_y, action = x - moves[k, 0], y - moves[k, 1], moves[k, 2]
            if not (0 <= from_x < size and 0 <= from_y < size):
                continue
            if not water[from_y, from_x] or steps[from_y, from_x] >= 0:
                continue
            straight = actions[y, x] == action
            run[from_y, from_x] = run[y, x] + 1 if straight else 1
            after_run[from_y, from_x] = after_run[y, x] if straight else steps[y, x]
            of_run = ceil(run[from_y, from_x] / paces[action] - ROUNDING)
            steps[from_y, from_x] = after_run[from_y, from_x] + of_run
            actions[from_y, from_x] = action
            queue[last, 0], queue[last, 1] = from_x, from_y
            last += 1

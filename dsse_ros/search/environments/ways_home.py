# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Routes home for drones with batteries that run down.

A drone's home is its start cell. Its route has the fewest moves, and few turns; against the wind a
move may take more than one step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.breadth_first import find_routes
from dsse_ros.base.fields import FieldError
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.world.scenario.actions import DIAGONAL, ActionSet, Cell

MAX_BYTES = 1 << 30
"""Limit for the routes of all drones together."""


class WaysHome(NamedTuple):
    """The route of each drone to its home from each cell.

    Attributes:
        steps: (N, R, C) int32, steps of the route from cell [y, x]; -1 if there is none.
        actions: (N, R, C) int8, first action of the route; -1 at home.
    """

    steps: NDArray[np.int32]
    actions: NDArray[np.int8]


def ways_home(
    actions: ActionSet,
    area: NDArray[np.bool_] | None,
    grid: GridShape,
    homes: Sequence[Cell],
    ratios: Sequence[Sequence[float]],
) -> WaysHome:
    """Return the routes home.

    Args:
        actions: The actions of the rules.
        area: (R, C) bool [row, col], the searched cells; None for all.
        grid: Its shape.
        homes: Cell (col, row) of each drone's home.
        ratios: For each drone and action, the share of the move that one step covers; 0 for an
            action that the drone cannot do.

    Raises:
        FieldError: If the tables would be too large, or a straight move is missing.
    """
    if 5 * len(homes) * grid.cells > MAX_BYTES:
        raise FieldError(
            f"drones x cells must be at most {MAX_BYTES // 5} with battery_move, got {len(homes)} "
            f"drones on {grid} cells"
        )
    try:
        actions.with_moves()
    except ValueError as error:
        raise FieldError(f"battery_move: {error}") from None
    steps = np.empty((len(homes), *grid.matrix), np.int32)
    numbers = np.empty(steps.shape, np.int8)
    cells = np.ones(grid.matrix, np.bool_) if area is None else area.copy()
    for home, of_drone, of_home, next_actions in zip(homes, ratios, steps, numbers, strict=True):
        table = np.array(_moves(actions, of_drone), np.int64)
        find_routes(cells, table, np.array(of_drone, float), *home, of_home, next_actions)
    return WaysHome(steps, numbers)


def _moves(actions: ActionSet, ratios: Sequence[float]) -> list[tuple[int, int, int]]:
    """Return the moves (dx, dy, number) that a drone can do."""
    moves = [
        (dx, dy, number)
        for number, (dx, dy) in enumerate(actions.moves)
        if (dx, dy) != (0, 0) and ratios[number] > 0
    ]
    diagonal = actions.diagonal and sum(0 not in move[:2] for move in moves) == len(DIAGONAL)
    return [move for move in moves if diagonal or 0 in move[:2]]

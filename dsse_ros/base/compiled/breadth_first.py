# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Routes to one cell, by breadth-first search."""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np

from dsse_ros.base.compiled.jit import compiled

ROUNDING = 1e-9
"""Tolerance for a whole number of steps: a quotient of two floats is not exact."""


@compiled()
def find_routes(
    area: Any, moves: Any, ratios: Any, col: int, row: int, steps: Any, actions: Any
) -> None:
    """Write the routes to one cell, from this goal outwards.

    Args:
        area: (R, C) bool [row, col], cells that moves may enter.
        moves: (M, 3) int64, steps (dx, dy) and numbers of the moves.
        ratios: For each number, the share of the move that one step covers.
        col: Column of the goal.
        row: Its row.
        steps: (R, C) int32 out, steps of the route from cell [y, x]; -1 without a route.
        actions: (R, C) int8 out, number of the route's first move; -1 at the goal.
    """
    rows, columns = area.shape
    steps[:] = -1
    actions[:] = -1
    queue = np.empty((rows * columns, 2), np.int32)
    # Moves in one direction from a cell, and the steps from where they end: progress against the
    # wind carries over from move to move, but not around a turn.
    run = np.zeros((rows, columns), np.int32)
    after_run = np.zeros((rows, columns), np.int32)
    queue[0, 0], queue[0, 1] = col, row
    steps[row, col] = 0
    first, last = 0, 1
    while first < last:
        x, y = queue[first]
        first += 1
        for k in range(len(moves)):
            from_x, from_y, action = x - moves[k, 0], y - moves[k, 1], moves[k, 2]
            if not (0 <= from_x < columns and 0 <= from_y < rows):
                continue
            if not area[from_y, from_x] or steps[from_y, from_x] >= 0:
                continue
            straight = actions[y, x] == action
            run[from_y, from_x] = run[y, x] + 1 if straight else 1
            after_run[from_y, from_x] = after_run[y, x] if straight else steps[y, x]
            of_run = ceil(run[from_y, from_x] / ratios[action] - ROUNDING)
            steps[from_y, from_x] = after_run[from_y, from_x] + of_run
            actions[from_y, from_x] = action
            queue[last, 0], queue[last, 1] = from_x, from_y
            last += 1

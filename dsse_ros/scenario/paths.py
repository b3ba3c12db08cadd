# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Shortest paths between the cells of an area, by breadth-first search."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Cell = tuple[int, int]


class Paths:
    """Shortest paths within an area.

    Args:
        area: (G, G) bool, [row, col].
        steps: The moves (dx, dy) in cells; each has its opposite.
    """

    def __init__(self, area: NDArray[np.bool_], steps: Sequence[Cell]) -> None:
        self._area = area
        self._steps = np.array(steps, np.int64).reshape(-1, 2)
        self.distances = lru_cache(maxsize=64)(self._distances)

    def _distances(self, goal: Cell) -> NDArray[np.int32]:
        """Return the number of moves from each cell to the goal, (G, G); -1 without a path."""
        distances = np.full(self._area.shape, -1, np.int32)
        size = len(distances)
        if 0 <= goal[0] < size and 0 <= goal[1] < size and self._area[goal[1], goal[0]]:
            _flood(self._area, self._steps, *goal, distances)
        return distances

    def next_cell(self, start: Cell, goal: Cell, preferred: Cell) -> Cell:
        """Return the next cell on a shortest path, the preferred one if possible.

        Without a path, return the present cell.
        """
        distances = self.distances(goal)
        left = distances[start[1], start[0]]
        if left <= 0:
            return start
        col, row = start
        ahead = [preferred, *((col + dx, row + dy) for dx, dy in self._steps.tolist())]
        size = len(distances)
        return next(
            (x, y)
            for x, y in ahead
            if 0 <= x < size and 0 <= y < size and distances[y, x] == left - 1
        )


@njit(cache=True, nogil=True)
def _flood(area: Any, steps: Any, col: int, row: int, distances: Any) -> None:
    """Write the number of moves to a cell; -1 stays where there is no path."""
    size = len(area)
    queue = np.empty((size * size, 2), np.int64)
    queue[0, 0], queue[0, 1] = col, row
    distances[row, col] = 0
    first, last = 0, 1
    while first < last:
        x, y = queue[first]
        first += 1
        for k in range(len(steps)):
            to_x, to_y = x + steps[k, 0], y + steps[k, 1]
            if not (0 <= to_x < size and 0 <= to_y < size):
                continue
            if area[to_y, to_x] and distances[to_y, to_x] < 0:
                distances[to_y, to_x] = distances[y, x] + 1
                queue[last, 0], queue[last, 1] = to_x, to_y
                last += 1

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Shortest paths between cells, by breadth-first search."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dsse_ros.compiled.routes import find_routes

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
        size, number = len(distances), np.arange(len(self._steps))
        if 0 <= goal[0] < size and 0 <= goal[1] < size and self._area[goal[1], goal[0]]:
            moves, ratios = np.column_stack([self._steps, number]), np.ones(len(number))
            find_routes(
                self._area, moves, ratios, *goal, distances, np.empty(distances.shape, np.int8)
            )
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

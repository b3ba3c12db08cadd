# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Shortest paths between cells, by breadth-first search."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.breadth_first import find_routes
from dsse_ros.base.grid_shape import GridShape

Cell = tuple[int, int]


class ShortestPaths:
    """Shortest paths within an area.

    Args:
        area: (R, C) bool, [row, col].
        steps: The moves (dx, dy) in cells.

    Attributes:
        two_way: Whether each move has its opposite, so that a path leads back too.
    """

    def __init__(self, area: NDArray[np.bool_], steps: Sequence[Cell]) -> None:
        self._area = area
        self._steps = [(dx, dy) for dx, dy in steps]
        self.two_way = {(-dx, -dy) for dx, dy in steps} == set(steps)
        self._distances = lru_cache(maxsize=64)(self._find)

    def distances_to(self, goal: Cell) -> NDArray[np.int32]:
        """Return the number of moves from each cell to the goal, (R, C); -1 without a path."""
        return self._distances(goal, 1)

    def distances_from(self, start: Cell) -> NDArray[np.int32]:
        """Return the number of moves from the start to each cell, (R, C); -1 without a path."""
        return self._distances(start, 1 if self.two_way else -1)

    def _find(self, end: Cell, sign: int) -> NDArray[np.int32]:
        """Return the distances to a cell (`sign` 1), or from it (-1)."""
        distances = np.full(self._area.shape, -1, np.int32)
        number, grid = np.arange(len(self._steps)), GridShape.of(distances)
        if grid.holds(*end) and self._area[end[1], end[0]]:
            steps = sign * np.array(self._steps, np.int64).reshape(-1, 2)
            moves, ratios = np.column_stack([steps, number]), np.ones(len(number))
            find_routes(
                self._area, moves, ratios, *end, distances, np.empty(distances.shape, np.int8)
            )
        return distances

    def next_cell(self, start: Cell, goal: Cell, preferred: Cell) -> Cell:
        """Return the next cell on a shortest path, the preferred one if possible.

        Without a path, return the present cell.
        """
        distances = self.distances_to(goal)
        left = distances[start[1], start[0]]
        if left <= 0:
            return start
        col, row = start
        ahead = [(col + dx, row + dy) for dx, dy in self._steps]
        if preferred in ahead:
            ahead.insert(0, preferred)
        grid = GridShape.of(distances)
        return next((x, y) for x, y in ahead if grid.holds(x, y) and distances[y, x] == left - 1)

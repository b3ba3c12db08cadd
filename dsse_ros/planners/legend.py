# SPDX-License-Identifier: Apache-2.0
"""The legend of the actions as moves on the grid."""

from __future__ import annotations

from collections.abc import Sequence

from dsse_ros.planners.planner import Cell
from dsse_ros.search.rules import ACTION_VECTORS

_STRAIGHT = ("left", "right", "up", "down")
_DIAGONAL = ("up_left", "up_right", "down_left", "down_right")


class Legend:
    """Moves between neighbouring cells, with or without diagonals as the legend allows.

    Diagonal moves are used when the legend has all four. Names that are no known action are
    never chosen.

    Args:
        actions: Names of the actions; the index is the action number.

    Raises:
        ValueError: If search or one of the four straight moves is missing.
    """

    def __init__(self, actions: Sequence[str]) -> None:
        missing = [name for name in (*_STRAIGHT, "search") if name not in actions]
        if missing:
            raise ValueError(f"actions: {', '.join(missing)} missing in {list(actions)!r}")
        self.diagonal = all(name in actions for name in _DIAGONAL)
        """Whether a step may change both coordinates."""
        usable = (*_STRAIGHT, *(_DIAGONAL if self.diagonal else ()), "search")
        self._number = {ACTION_VECTORS[name]: list(actions).index(name) for name in usable}
        self._vectors = [vector for vector in self._number if vector != (0, 0)]

    def action(self, start: Cell, end: Cell) -> int:
        """Return the number of the move from a cell to its neighbour; staying is a search."""
        return self._number[end[0] - start[0], end[1] - start[1]]

    def towards(self, start: Cell, goal: Cell) -> Cell:
        """Return the cell one step closer to the goal; the goal itself once there.

        Diagonally while both axes differ; without diagonals along the axis with the larger
        difference, along the row when they are equal.
        """
        (col, row), (goal_col, goal_row) = start, goal
        d_col, d_row = goal_col - col, goal_row - row
        if not self.diagonal:
            if abs(d_col) >= abs(d_row):
                d_row = 0
            else:
                d_col = 0
        return col + (d_col > 0) - (d_col < 0), row + (d_row > 0) - (d_row < 0)

    def distance(self, start: Cell, end: Cell) -> int:
        """Return the number of moves between two cells on an empty grid."""
        d_col, d_row = abs(start[0] - end[0]), abs(start[1] - end[1])
        return max(d_col, d_row) if self.diagonal else d_col + d_row

    def neighbours(self, cell: Cell, size: int) -> list[Cell]:
        """Return the cells of a size x size grid that are one move away."""
        col, row = cell
        return [
            (col + d_col, row + d_row)
            for d_col, d_row in self._vectors
            if 0 <= col + d_col < size and 0 <= row + d_row < size
        ]

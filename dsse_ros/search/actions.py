# SPDX-License-Identifier: Apache-2.0
"""The actions of a search by number: their names, moves and masks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")

Cell = tuple[int, int]
"""(col, row): col grows to the east, row to the south."""

ACTION_VECTORS: dict[str, tuple[int, int]] = {
    "left": (-1, 0),
    "right": (1, 0),
    "up": (0, -1),
    "down": (0, 1),
    "up_left": (-1, -1),
    "up_right": (1, -1),
    "down_left": (-1, 1),
    "down_right": (1, 1),
    "search": (0, 0),
}
"""Step of each action in cells (dx to the east, dy to the south)."""

STRAIGHT = ("left", "right", "up", "down")
DIAGONAL = ("up_left", "up_right", "down_left", "down_right")


class ActionSet:
    """Actions by number, and the way over the grid that their moves allow.

    Diagonal moves are used where all four are there. An action of an unknown name stays in its
    cell and is never chosen.

    Args:
        names: Names of the actions; the index is the action number.

    Attributes:
        names: The names.
        moves: Of each action its step (dx, dy) in cells, to the east and to the south.
        search: Number of the action search.
        diagonal: Whether a step may change both coordinates.

    Raises:
        ValueError: If search is missing.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self.names = tuple(names)
        self._check("search")
        self.moves = tuple(ACTION_VECTORS.get(name, (0, 0)) for name in self.names)
        self.search = self.names.index("search")
        self.diagonal = all(name in self.names for name in DIAGONAL)
        usable = (*STRAIGHT, *(DIAGONAL if self.diagonal else ()), "search")
        self._number = {
            ACTION_VECTORS[name]: self.names.index(name) for name in usable if name in self.names
        }

    def __len__(self) -> int:
        return len(self.names)

    def __str__(self) -> str:
        """All actions with their numbers, for messages to people."""
        return ", ".join(f"{number} {name}" for number, name in enumerate(self.names))

    def _check(self, *needed: str) -> None:
        missing = [name for name in needed if name not in self.names]
        if missing:
            raise ValueError(f"actions: {', '.join(missing)} missing in {list(self.names)!r}")

    def with_moves(self) -> ActionSet:
        """Return these actions, which lead to every cell.

        Raises:
            ValueError: If one of the four straight moves is missing.
        """
        self._check(*STRAIGHT)
        return self

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
            for d_col, d_row in self._number
            if (d_col, d_row) != (0, 0) and 0 <= col + d_col < size and 0 <= row + d_row < size
        ]

    def masks(self, grid_size: int) -> list[list[NDArray[np.int8]]]:
        """Return by [row][col] the action masks (A,) int8, 0 where a move would leave the grid.

        They are read-only; equal ones, and equal rows, are one object. The last row and column
        are for a drone just outside, at -1 or G.
        """

        def mask(west: bool, east: bool, north: bool, south: bool) -> NDArray[np.int8]:
            blocked = {(-1, 0): west, (1, 0): east, (0, -1): north, (0, 1): south}
            free = [not (blocked.get((dx, 0)) or blocked.get((0, dy))) for dx, dy in self.moves]
            made = np.array(free, np.int8)
            made.flags.writeable = False
            return made

        def along(make: Callable[[bool, bool], T]) -> list[T]:
            edges = [(i == 0, i == grid_size - 1) for i in range(grid_size)] + [(False, False)]
            distinct = {edge: make(*edge) for edge in set(edges)}
            return [distinct[edge] for edge in edges]

        return along(lambda north, south: along(lambda west, east: mask(west, east, north, south)))

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The shape of a grid: its columns and rows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from typing_extensions import Self


class GridShape(NamedTuple):
    """How many cells a grid has along each axis, C columns and R rows.

    Cells are (col, row), column 0 is in the west and row 0 in the north. Compiled functions take a
    shape too.

    Attributes:
        columns: Cells from west to east.
        rows: Cells from north to south.
    """

    columns: int
    rows: int

    @classmethod
    def of(cls, matrix: NDArray[Any]) -> Self:
        """Return the shape of the grid of one or more matrices, (..., R, C)."""
        rows, columns = matrix.shape[-2:]
        return cls(columns, rows)

    @classmethod
    def square(cls, side: int) -> Self:
        """Return the shape of a square grid."""
        return cls(side, side)

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.columns * self.rows

    @property
    def matrix(self) -> tuple[int, int]:
        """Shape (R, C) of an array [row, col]."""
        return self.rows, self.columns

    @property
    def shorter(self) -> int:
        """Cells along the shorter side."""
        return min(self.columns, self.rows)

    @property
    def longer(self) -> int:
        """Cells along the longer side."""
        return max(self.columns, self.rows)

    def extent(self, cell_m: float) -> GridExtent:
        """Return the width and height of the grid with cells of this side, in metres."""
        return GridExtent(self.columns * cell_m, self.rows * cell_m)

    def padded(self, margin: int) -> GridShape:
        """Return the shape with so many more cells on each side."""
        return GridShape(self.columns + 2 * margin, self.rows + 2 * margin)

    def holds(self, col: int, row: int) -> bool:
        """Return whether a cell is on the grid."""
        return 0 <= col < self.columns and 0 <= row < self.rows

    def __str__(self) -> str:
        """Return "C x R"."""
        return f"{self.columns} x {self.rows}"


class GridExtent(NamedTuple):
    """How long and how wide a grid is, in metres.

    Attributes:
        width: From west to east.
        height: From north to south.
    """

    width: float
    height: float

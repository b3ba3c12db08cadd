# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Checks of cells of a scenario and of a reset, against the grid and each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, shown
from dsse_ros.base.grid_shape import GridShape


def check_cell(
    name: str, cell: tuple[int, int], grid: GridShape, mask: NDArray[np.bool_] | None = None
) -> None:
    """Raise unless the cell (col, row) is on the grid and, with a mask (R, C), in the area.

    Raises:
        FieldError: If the cell is outside.
    """
    if not grid.holds(*cell):
        col, row = (f"from 0 to {size - 1}" for size in grid)
        wanted = f"col and row {col}" if col == row else f"col {col} and row {row}"
        raise FieldError(f"{name} must have {wanted}, got {list(cell)}")
    if mask is not None and not mask[cell[1], cell[0]]:
        raise FieldError(
            f"{name} must be one of the {int(mask.sum())} cells of the area, got {list(cell)}"
        )


def check_positions(
    positions: tuple[tuple[int, int], ...],
    grid: GridShape,
    count: int | None,
    mask: NDArray[np.bool_] | None,
    apart: bool,
) -> None:
    """Raise unless these are `count` cells of the grid and, with a mask, of the area.

    Raises:
        FieldError: If there are too few or too many, or a cell is outside or, if drones must be
            `apart`, occurs twice.
    """
    if not positions or (count is not None and len(positions) != count):
        raise FieldError(
            f"drones_positions must be one cell per drone ({count or 'at least 1'}), got "
            f"{len(positions)}"
        )
    for cell in positions:
        check_cell("drones_positions", cell, grid, mask)
    if apart and len(set(positions)) != len(positions):
        raise FieldError(f"drones_positions must be different cells, got {shown(list(positions))}")


def check_multipliers(multipliers: tuple[float, ...] | None, person_amount: int) -> None:
    """Raise unless there is one multiplier per person.

    Raises:
        FieldError: If the numbers differ.
    """
    if multipliers is not None and len(multipliers) != person_amount:
        raise FieldError(
            f"person_pod_multipliers must be one per person ({person_amount}), got "
            f"{len(multipliers)}"
        )


def check_scatter(
    amount: int,
    cell: tuple[int, int],
    grid: GridShape,
    scatter: int,
    mask: NDArray[np.bool_] | None = None,
) -> None:
    """Raise unless the cells within `scatter` of the cell have room for every person.

    Raises:
        FieldError: If there are more persons than cells.
    """
    cols, rows = (
        range(max(c - scatter, 0), min(c + scatter + 1, size))
        for c, size in zip(cell, grid, strict=True)
    )
    room = len(cols) * len(rows)
    if mask is not None:
        room = int(mask[rows.start : rows.stop, cols.start : cols.stop].sum())
    if amount > room:
        raise FieldError(
            f"person_amount must be at most {room}, the cells within {scatter} of "
            f"person_initial_position {list(cell)}, got {amount}"
        )

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How large a grid may be that a file, a message or a parameter asks for."""

from __future__ import annotations

import math

from dsse_ros.scenario.fields import FieldError

MAX_SIDE = 10_000
"""Cells along a side of the largest grid that there can be, as `grid_size` of a scenario has it."""
LARGEST_GRID_CELLS = 4_000_000
"""Cells of the largest grid that gets memory without being asked for one as large."""


def check_cells(grid_size: int, max_cells: int) -> None:
    """Raise for a grid of more than `max_cells`, before there is any memory for it.

    Raises:
        FieldError: If it is one.
    """
    if grid_size * grid_size > max_cells:
        raise FieldError(
            f"grid_size: {grid_size} is not allowed; at most {math.isqrt(max_cells)}, for "
            f"max_cells {max_cells}"
        )

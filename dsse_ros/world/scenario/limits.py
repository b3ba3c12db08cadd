# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Limits and defaults of grids from a file, a message or a parameter."""

from __future__ import annotations

from dsse_ros.base.fields import FieldError
from dsse_ros.base.grid_shape import GridShape

MAX_SIDE = 10_000
"""Cells along the longest possible side of a grid, the limit of a scenario's `grid_size`."""
CELL_SIZE_M = (1e-3, 1e6)
"""Smallest and largest side of a cell."""
LARGEST_GRID_CELLS = 4_000_000
"""Cells of the largest grid allocated without an explicit request for a larger one."""
DEFAULT_ORIGIN_DEG = (-24.04, -46.17)
"""Latitude and longitude of a grid for which none are given, off Santos (DSSE 1.1.9)."""
MAX_PRE_SEARCH_STEPS = 1_000_000
"""Steps of drift before the drones arrive."""
MAX_ID = 2**32 - 1
"""Largest run_id and mission: uint32 in the reports."""
MAX_SEED = 2**62
"""Largest seed of a parameter, an option or a file: the next missions' seeds are int64, too."""


def check_cells(grid: GridShape, max_cells: int) -> None:
    """Raise for a grid with more than `max_cells`, before any memory is allocated for it.

    Raises:
        FieldError: If the grid is too large.
    """
    if grid.cells > max_cells:
        raise FieldError(
            f"grid_size must have at most {max_cells} cells, see max_cells, got {grid}"
        )


def check_pre_search(minutes: float, steps: int, step_s: float) -> None:
    """Raise for a drift before the search with too many steps to compute.

    Raises:
        FieldError: If there are more than `MAX_PRE_SEARCH_STEPS`.
    """
    if steps > MAX_PRE_SEARCH_STEPS:
        raise FieldError(
            f"pre_search_minutes must be at most {MAX_PRE_SEARCH_STEPS} steps of {step_s:g} s, "
            f"got {minutes:g}"
        )

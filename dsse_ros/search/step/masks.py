# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Action masks: which moves stay on the grid and in the area."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import inlined, kernel
from dsse_ros.search.step.constants import Constants
from dsse_ros.search.step.entities import Area, Records
from dsse_ros.search.step.recipe import cell_after
from dsse_ros.world.targets.sea_map import grid_of, is_inside


@inlined
def mask_moves(constants: Constants, area: Area, x: int, y: int, mask: NDArray[np.int8]) -> None:
    """Clear the moves out of the grid or the area in a mask (A,) of ones."""
    edge_x, edge_y = constants.columns - 1, constants.rows - 1
    inner_x, inner_y = np.uint64(max(edge_x - 1, 0)), np.uint64(max(edge_y - 1, 0))
    if area is not None and is_inside(grid_of(constants), x, y):
        for a in range(len(mask)):
            _, _, mask[a] = cell_after(constants, area, x, y, a)
    elif (np.uint64(x - 1) >= inner_x) | (np.uint64(y - 1) >= inner_y):
        for a in range(len(mask)):
            dx, dy = constants.dx[a], constants.dy[a]
            west, east = dx < 0 and x == 0, dx > 0 and x == edge_x
            north, south = dy < 0 and y == 0, dy > 0 and y == edge_y
            mask[a] = not (west or east or north or south)


@kernel
def write_masks(
    constants: Records,
    area: Area,
    x: NDArray[np.int64],
    y: NDArray[np.int64],
    masks: NDArray[np.int8],
) -> None:
    """Write the action masks (K, A) int8 in cells, 0 for moves out of the grid or the area.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        area: Of `Sea`.
        x: (K,) int64 columns.
        y: (K,) int64 rows.
        masks: Out.
    """
    masks[:] = 1
    for k in range(len(masks)):
        mask_moves(constants[0], area, x[k], y[k], masks[k])


def mask_table(
    constants: NDArray[np.void], area: NDArray[np.bool_] | None
) -> list[list[NDArray[np.int8]]]:
    """Return the action masks (A,) int8 by [row][col].

    They are read-only, and equal masks are the same object. The last row and column are for a
    drone just outside, at -1, or at C or R.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        area: Of `Sea`.
    """
    columns, rows, count = (int(constants[name][0]) for name in ("columns", "rows", "num_actions"))
    (cols, of_col), (lines, of_row) = (_distinct(size, area is None) for size in (columns, rows))
    masks = np.empty((len(cols) * len(lines), count), np.int8)
    x, y = np.tile(cols, len(lines)), np.repeat(lines, len(cols))
    write_masks(constants, area, x, y, masks)
    codes = masks @ (1 << np.arange(count))
    distinct = np.empty(1 << count, object)
    for code, k in zip(*np.unique(codes, return_index=True), strict=True):
        distinct[code] = np.frombuffer(masks[k].tobytes(), np.int8)
    by_row = distinct[codes].reshape(len(lines), -1)[:, of_col].tolist()
    return [by_row[k] for k in of_row]


def _distinct(size: int, edge_only: bool) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the lines 0 .. size whose masks may differ, and for each line the number of its like.

    Args:
        size: Number of lines on the grid, columns or rows.
        edge_only: Whether only those at the edge differ from others.
    """
    alike = np.arange(size + 1)
    if edge_only:
        alike[1 : size - 1] = 1
    lines, of_line = np.unique(alike, return_inverse=True)
    return lines, of_line

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The cells that a vehicle passes on its way, without ROS."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.actions import Cell


class Pass(NamedTuple):
    """A pass over a cell.

    Attributes:
        cell: (col, row).
        piece: Number of the piece of the path on which the vehicle first looked at it.
    """

    cell: Cell
    piece: int


class PassedCells:
    """Finds the cells that one vehicle passes.

    It passes a cell if it looks within half a cell of its centre, and again only after it has been
    outside the circle through its corners. On straight paths of any course these are on average as
    many cells as the path is long. The cell where it begins is not passed.

    Args:
        cell_m: Side of a cell.
        grid_size: Cells along a side of the grid.
    """

    def __init__(self, cell_m: float, grid_size: int) -> None:
        self._cell_m, self._grid_size = cell_m, grid_size
        # The passed cells near the vehicle; None before it begins.
        self._passed: set[Cell] | None = None

    def begin(self) -> None:
        """Begin a mission where the vehicle is then."""
        self._passed = None

    def take(self, path: NDArray[np.float64], looked: NDArray[np.bool_]) -> list[Pass]:
        """Return the passes of a step in their order.

        Args:
            path: (K + 1, 2) float64, metres to the east and to the south of the grid's north-west
                corner.
            looked: (K + 1,) bool, see `step.sightings.missed`.
        """
        cells = self._cells_near(path)
        centres, legs = (np.array(cells).reshape(-1, 2) + 0.5) * self._cell_m, np.diff(path, axis=0)
        # (K, C, 2) from the beginning of each piece to each centre, and (K, C) the nearest share.
        to = centres - path[:-1, None]
        squared = np.maximum((legs**2).sum(axis=1), 1e-12)
        share = np.clip((to * legs[:, None]).sum(axis=2) / squared[:, None], 0.0, 1.0)
        within = np.hypot(*np.moveaxis(to - share[..., None] * legs[:, None], 2, 0))
        within = within <= self._cell_m / 2
        inside = np.hypot(*np.moveaxis(centres - path[:, None], 2, 0))
        if self._passed is None:
            self._passed = {cells[i] for i in np.flatnonzero(inside[0] <= self._cell_m / 2)}
        passes = []
        for k in range(len(legs)):
            for i in np.flatnonzero(within[k] & looked[k + 1]).tolist():
                if cells[i] not in self._passed:
                    passes.append(Pass(cells[i], k))
                    self._passed.add(cells[i])
            near = np.flatnonzero(inside[k + 1] <= self._cell_m / math.sqrt(2.0))
            self._passed &= {cells[i] for i in near}
        return passes

    def _cells_near(self, path: NDArray[np.float64]) -> list[Cell]:
        """Return the cells of the grid around a path."""
        low = np.floor(path.min(axis=0) / self._cell_m).astype(np.int64) - 1
        high = np.floor(path.max(axis=0) / self._cell_m).astype(np.int64) + 1
        west, north = np.maximum(low, 0).tolist()
        east, south = np.minimum(high, self._grid_size - 1).tolist()
        return [(col, row) for row in range(north, south + 1) for col in range(west, east + 1)]

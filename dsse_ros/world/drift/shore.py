# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The shore as a raster of land, on which particles strand."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.world.drift.kernels import degrees_per_metre

CELL_M = 20.0
"""Side of a cell of the raster: a sixth of a cell of 130 m."""
MAX_CELLS = 30_000_000
_BLOCK_CELLS = 1 << 18

IsLand = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.bool_]]
"""Returns whether positions (latitudes, longitudes) are on land."""


class Shore(NamedTuple):
    """Where land is within a box; beyond it everything is sea.

    Attributes:
        land: (R, C) bool, row 0 in the south, column 0 in the west.
        south_deg: Latitude of the box's southern edge.
        west_deg: Longitude of its western edge.
        lat_step_deg: Height of a cell.
        lon_step_deg: Width of a cell.
    """

    land: NDArray[np.bool_]
    south_deg: float
    west_deg: float
    lat_step_deg: float
    lon_step_deg: float


class Box(NamedTuple):
    """A part of the Earth in degrees; it does not cross the poles."""

    south_deg: float
    north_deg: float
    west_deg: float
    east_deg: float

    @property
    def middle_deg(self) -> tuple[float, float]:
        """Latitude and longitude of its middle."""
        return (self.south_deg + self.north_deg) / 2, (self.west_deg + self.east_deg) / 2

    def turned(self, lons_deg: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return longitudes within half a turn of its middle, as its own sides are."""
        middle = self.middle_deg[1]
        turned: NDArray[np.float64] = (lons_deg - middle + 180.0) % 360.0 - 180.0 + middle
        return turned


def box_around(
    lats_deg: NDArray[np.float64], lons_deg: NDArray[np.float64], margin_m: float
) -> Box:
    """Return the box of these positions and this margin around them."""
    south, north = float(lats_deg.min()), float(lats_deg.max())
    lat_per_m, lon_per_m = degrees_per_metre(max(abs(south), abs(north)))
    return Box(
        max(south - margin_m * lat_per_m, -90.0),
        min(north + margin_m * lat_per_m, 90.0),
        float(lons_deg.min()) - margin_m * lon_per_m,
        float(lons_deg.max()) + margin_m * lon_per_m,
    )


def shore_of(is_land: IsLand, box: Box) -> Shore:
    """Return the shore within a box, in cells of `CELL_M` or, in a large box, larger ones."""
    lat_step, lon_step = (CELL_M * part for part in degrees_per_metre(box.middle_deg[0]))
    rows = (box.north_deg - box.south_deg) / lat_step
    cols = (box.east_deg - box.west_deg) / lon_step
    coarser = max(1.0, math.sqrt(rows * cols / MAX_CELLS))
    lat_step, lon_step = lat_step * coarser, lon_step * coarser
    shape = max(math.ceil(rows / coarser), 1), max(math.ceil(cols / coarser), 1)
    land = np.zeros(shape, np.bool_)
    lons = box.west_deg + (np.arange(shape[1]) + 0.5) * lon_step
    count = max(_BLOCK_CELLS // shape[1], 1)
    for first in range(0, shape[0], count):
        row = np.arange(first, min(first + count, shape[0]))
        lats = box.south_deg + (row + 0.5) * lat_step
        land[row] = is_land(*np.meshgrid(lats, lons, indexing="ij"))
    return Shore(land, box.south_deg, box.west_deg, lat_step, lon_step)

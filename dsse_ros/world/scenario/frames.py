# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The grid in the `map` frame: cells (col, row) to metres and back.

The map frame is ENU (REP-103, REP-105): x east, y north, z up, in metres, with its origin at the
grid's south-west corner. Columns grow to the east; rows grow to the south, row 0 is north.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsse_ros.base.grid_shape import GridExtent, GridShape
from dsse_ros.world.scenario.limits import CELL_SIZE_M

F = TypeVar("F", float, NDArray[Any])
"""Numbers or arrays of them."""


@dataclass(frozen=True)
class GridFrame:
    """Where the grid lies on the Earth and how high the drones fly.

    Attributes:
        grid_size: Columns and rows of the grid, or one number for a square.
        cell_size_m: Side of a cell.
        origin_lat_deg: WGS84 latitude of the grid's south-west corner.
        origin_lon_deg: WGS84 longitude of the grid's south-west corner.
        origin_alt_m: Height of the map plane above the WGS84 ellipsoid at that corner.
        alt_m: Flight altitude above the map plane.
        alts_m: That of each drone, where they differ from it.
        map_frame: Name of the frame.
        frame_prefix: What the names of the drones' frames begin with; the map frame's name has it
            already.

    Raises:
        ValueError: If a value is not allowed.
    """

    grid_size: GridShape
    cell_size_m: float
    origin_lat_deg: float
    origin_lon_deg: float
    origin_alt_m: float
    alt_m: float
    map_frame: str = "map"
    frame_prefix: str = ""
    alts_m: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        # Messages take Python numbers only; NumPy's would be corrupted silently.
        grid: Any = self.grid_size
        grid = (
            GridShape(*map(int, grid)) if isinstance(grid, tuple) else GridShape.square(int(grid))
        )
        object.__setattr__(self, "grid_size", grid)
        for name in ("cell_size_m", "origin_lat_deg", "origin_lon_deg", "origin_alt_m", "alt_m"):
            object.__setattr__(self, name, float(getattr(self, name)))
        object.__setattr__(self, "alts_m", tuple(float(alt_m) for alt_m in self.alts_m))
        if min(grid) < 1:
            raise ValueError(f"grid_size must be at least 1, got {list(grid)}")
        smallest, largest = CELL_SIZE_M
        if not smallest <= self.cell_size_m <= largest:
            raise ValueError(
                f"cell_size_m must be {smallest:g} to {largest:g}, got {self.cell_size_m!r}"
            )
        for name, limit, value in (
            ("origin_lat_deg", 90.0, self.origin_lat_deg),
            ("origin_lon_deg", 360.0, self.origin_lon_deg),
            ("origin_alt_m", 1e6, self.origin_alt_m),
            *(("alt_m", 1e6, alt_m) for alt_m in (self.alt_m, *self.alts_m)),
        ):
            if not abs(value) <= limit:
                raise ValueError(f"{name} must be {-limit} to {limit}, got {value!r}")
        if not self.map_frame:
            raise ValueError("map_frame must be a name, got ''")

    @property
    def extent(self) -> GridExtent:
        """The width and height of the grid in metres."""
        return self.grid_size.extent(self.cell_size_m)

    @property
    def origin(self) -> tuple[float, float, float]:
        """WGS84 latitude, longitude and altitude of the south-west corner."""
        return self.origin_lat_deg, self.origin_lon_deg, self.origin_alt_m

    def altitudes_m(self, drones: int) -> list[float]:
        """Return the flight altitude of each of N drones.

        Raises:
            ValueError: If they differ, and there are other than N.
        """
        if self.alts_m and len(self.alts_m) != drones:
            raise ValueError(f"drones must be {len(self.alts_m)}, got {drones}")
        return list(self.alts_m) or [self.alt_m] * drones

    def alt_of(self, drone: int) -> float:
        """Return the flight altitude of one drone, by its number."""
        return self.alts_m[drone] if self.alts_m else self.alt_m


def cell_centre(grid: GridShape, cell_size_m: float, col: Any, row: Any) -> tuple[Any, Any]:
    """Return the centre of a cell in metres from the grid's south-west corner, x east and y north.

    Args:
        grid: Its shape.
        cell_size_m: Side of a cell.
        col: Column; a fraction lies between cells. A number or an array.
        row: Row, 0 in the north; a number or an array of the same shape.
    """
    return (col + 0.5) * cell_size_m, (grid.rows - 1 - row + 0.5) * cell_size_m


def cell_to_map(frame: GridFrame, col: F, row: F) -> tuple[F, F]:
    """Return the centre of a cell in metres in the map frame, x east and y north.

    Args:
        frame: The grid.
        col: Column; a fraction lies between cells. A number or an array.
        row: Row, likewise and of the same shape.
    """
    return cell_centre(frame.grid_size, frame.cell_size_m, col, row)


def map_to_places(frame: GridFrame, x_m: F, y_m: F) -> tuple[F, F]:
    """Return (col, row) of a point, with fractions between cells; the inverse of `cell_to_map`.

    Args:
        frame: The grid.
        x_m: Metres to the east in the map frame; a number or an array.
        y_m: Metres to the north, likewise and of the same shape.
    """
    cell_m = frame.cell_size_m
    return x_m / cell_m - 0.5, frame.grid_size.rows - 0.5 - y_m / cell_m


def flip_y(height_m: float, y_m: F) -> F:
    """Return metres from the other horizontal edge of the grid: north to south, or back.

    y counts from the southern edge in the map frame, and from the northern one in the search.

    Args:
        height_m: From the southern to the northern edge.
        y_m: Metres from one edge, a number or an array.
    """
    return height_m - y_m


def map_positions(
    frame: GridFrame, cells: ArrayLike, drone: int | None = None
) -> list[tuple[float, float, float]]:
    """Return points (x, y, z) in metres in the map frame over cells, at flight altitude.

    Args:
        frame: The grid.
        cells: Cells (col, row), fractions lie between cells: (N, 2), one of each drone, or (K, 2)
            of one drone.
        drone: Number of that drone.

    Raises:
        ValueError: If the altitudes differ by drone, and there are other than N.
    """
    array = np.asarray(cells, dtype=np.float64).reshape(-1, 2)
    x_m, y_m = cell_to_map(frame, array[:, 0], array[:, 1])
    count = len(array)
    alts_m = frame.altitudes_m(count) if drone is None else [frame.alt_of(drone)] * count
    return list(zip(x_m.tolist(), y_m.tolist(), alts_m, strict=True))


def map_to_cell(frame: GridFrame, x_m: float, y_m: float) -> tuple[int, int] | None:
    """Return the cell (col, row) that holds a point; None outside the grid or if not finite.

    A cell holds its western and southern border.
    """
    east = x_m / frame.cell_size_m
    north = y_m / frame.cell_size_m
    columns, rows = frame.grid_size
    if not (0 <= east < columns and 0 <= north < rows):
        return None
    return int(east), rows - 1 - int(north)

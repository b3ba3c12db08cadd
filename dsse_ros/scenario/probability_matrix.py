# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A given probability matrix: an array, or a file (.npy, CSV or GeoTIFF)."""

from __future__ import annotations

import csv
import math
import os
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np
from numpy.typing import NDArray

from dsse_ros.extras import pip_install
from dsse_ros.scenario.array_files import check_numbers, read_npy
from dsse_ros.scenario.fields import FieldError, shown
from dsse_ros.scenario.frames import cell_centre
from dsse_ros.scenario.given_array import GivenArray, frozen
from dsse_ros.scenario.limits import MAX_SIDE

if TYPE_CHECKING:
    from dsse_ros.scenario.geodesy import Origin

NAME = "probability_matrix"
ALLOWED = (
    f"a square matrix of finite numbers >= 0, not all 0, at most {MAX_SIDE} a side, or a file of "
    "one: .npy, .csv, .tif or .tiff"
)

_LONGEST_LINE = 32 * MAX_SIDE
"""Characters of a line in a CSV file; a float64 takes 25."""

_M_PER_DEG = 111_320.0
"""Metres per degree of latitude; precise enough to check the place of a cell."""


@dataclass(frozen=True)
class ProbabilityMatrix(GivenArray):
    """A matrix (G, G) [row, col] with row 0 in the north.

    Attributes:
        corners: Latitude and longitude in degrees of the centres of the north-west, north-east,
            south-west and south-east cells; None without georeference.
    """

    corners: tuple[tuple[float, float], ...] | None = field(compare=False)

    NAME = NAME
    ALLOWED = ALLOWED

    @classmethod
    def _made(
        cls,
        path: str,
        array: NDArray[Any],
        corners: tuple[tuple[float, float], ...] | None = None,
    ) -> ProbabilityMatrix:
        check_numbers(array.dtype)
        _check_shape(array.shape)
        if not np.isfinite(array).all() or not array.any() or array.min() < 0:
            raise ValueError
        digest, values = frozen(array)
        return cls(digest, path, values, corners)

    def check_place(self, grid_size: int, cell_size_m: float, origin: Origin) -> None:
        """Raise as `GivenArray.check_place` does; no corner may be off by more than half a cell."""
        super().check_place(grid_size, cell_size_m, origin)
        if self.corners is None:
            return
        from dsse_ros.scenario.geodesy import surface_to_geodetic

        edge = grid_size - 1
        col, row = np.array([0, edge, 0, edge]), np.array([0, 0, edge, edge])
        lat, lon = surface_to_geodetic(origin, *cell_centre(grid_size, cell_size_m, col, row))
        given_lat, given_lon = np.array(self.corners).T
        north = (given_lat - lat) * _M_PER_DEG
        # Take the difference the shorter way round the Earth.
        degrees = (given_lon - lon + 180.0) % 360.0 - 180.0
        off_m = float(np.hypot(north, degrees * _M_PER_DEG * np.cos(np.radians(lat))).max())
        if not off_m <= cell_size_m / 2:
            raise FieldError(
                f"{NAME} must be at most half a cell from the grid of origin_lat, origin_lon and "
                f"cell_size, got {self.source} with a corner {off_m:.0f} m from that of the grid"
            )


_Read = tuple[NDArray[Any], tuple[tuple[float, float], ...] | None]


def _check_shape(shape: tuple[int, ...]) -> None:
    """Raise unless this shape is allowed, before any memory is allocated.

    Raises:
        ValueError: If it is not.
    """
    if len(shape) != 2 or shape[0] != shape[1] or not 1 <= shape[0] <= MAX_SIDE:
        raise ValueError


def _read_npy(path: str) -> _Read:
    return read_npy(path, _check_shape), None


def _read_csv(path: str) -> _Read:
    rows: list[NDArray[np.float64]] = []
    with open(path, newline="", encoding="utf-8-sig") as file:
        for row in csv.reader(_lines(file)):
            if row:
                rows.append(np.array([float(value) for value in row]))
                if len(rows) > MAX_SIDE or len(rows[-1]) != len(rows[0]):
                    raise ValueError
    return np.array(rows), None


def _lines(file: TextIO) -> Iterator[str]:
    """Yield the lines of a CSV file, none longer than those of the largest matrix.

    Raises:
        ValueError: If a line is longer.
    """
    while line := file.readline(_LONGEST_LINE):
        if len(line) == _LONGEST_LINE:
            raise ValueError
        yield line


def _read_tiff(path: str) -> _Read:
    """Return the first band, north up, 0 where it has no data, and the positions of its corners."""
    try:
        import rasterio
    except ModuleNotFoundError:
        raise FieldError(
            f"{NAME}: {shown(path)} needs rasterio; {pip_install('geotiff')}"
        ) from None
    # Raise the usual error for a missing file; that of rasterio differs.
    os.stat(path)
    try:
        with warnings.catch_warnings():
            # A file without georeference is allowed.
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            raster = rasterio.open(path)
        with raster:
            _check_shape(raster.shape)
            # rasterio reads a block as a whole, even if it is larger than the image.
            if math.prod(raster.block_shapes[0]) > MAX_SIDE**2:
                raise ValueError
            values = raster.read(1, masked=True).filled(0)
            place = raster.transform
            if place.b or place.d:
                raise FieldError(f"{NAME} must have its rows from west to east, got {shown(path)}")
            rows, cols = [0, raster.shape[0] - 1], [0, raster.shape[1] - 1]
            # Rows from the south are those of a transform that is no mere numbering.
            if place.e > 0 and not place.is_identity:
                values, rows = values[::-1], rows[::-1]
            if place.a < 0:
                values, cols = values[:, ::-1], cols[::-1]
            values = np.ascontiguousarray(values)
            if raster.crs is None:
                return values, None
            x, y = rasterio.transform.xy(place, np.repeat(rows, 2), np.tile(cols, 2))
            corners = _on_earth(path, raster.crs, x, y)
    except rasterio.errors.RasterioError:
        raise ValueError from None
    return values, corners


def _on_earth(path: str, crs: Any, x: Any, y: Any) -> tuple[tuple[float, float], ...]:
    """Return latitudes and longitudes of points.

    Raises:
        FieldError: If one is off the Earth.
    """
    from rasterio.warp import transform

    try:
        lon, lat = transform(crs, "EPSG:4326", x, y)
    # The errors of GDAL have no common base.
    except Exception:
        lon, lat = [math.nan], [math.nan]
    if not np.isfinite([*lon, *lat]).all():
        raise FieldError(f"{NAME} must have its corners on the Earth, got {shown(path)}")
    return tuple(zip(lat, lon, strict=True))


ProbabilityMatrix.READERS = {
    ".npy": _read_npy,
    ".csv": _read_csv,
    ".tif": _read_tiff,
    ".tiff": _read_tiff,
}

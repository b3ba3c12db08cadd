# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The grid and other rasters on the Earth, by rasterio (extra `geotiff`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.defects import reason_of
from dsse_ros.base.extras import pip_install
from dsse_ros.base.fields import FieldError
from dsse_ros.base.grid_shape import GridShape

if TYPE_CHECKING:
    from dsse_ros.world.scenario.geodesy import Origin

_SAME_CELL = 0.1
"""Share of a cell by which the corners of a raster on the grid may be off."""


class Raster(NamedTuple):
    """Where the cells of a raster lie.

    Attributes:
        crs: Coordinate reference system.
        transform: Affine transformation from columns and rows to its plane.
    """

    crs: Any
    transform: Any

    def is_on_earth(self, shape: tuple[int, int]) -> bool:
        """Return whether the corners of a raster of some rows and columns are on the Earth."""
        rows, cols = shape
        corners = _applied(self.transform, *np.array([[0, cols, 0, cols], [0, 0, rows, rows]]))
        return bool(np.isfinite(_transformed(self.crs, "EPSG:4326", *corners)).all())

    def is_near(self, other: Raster, grid: GridShape) -> bool:
        """Return whether the cells of another raster, of a grid of as many, are the same."""
        (columns, rows) = grid
        corners = np.array([[0, columns, 0, columns], [0, 0, rows, rows]])
        there = _transformed(other.crs, self.crs, *_applied(other.transform, *corners))
        return bool(np.abs(_applied(~self.transform, *there) - corners).max() <= _SAME_CELL)

    def resampled(
        self, values: NDArray[np.float64], other: Raster, grid: GridShape
    ) -> NDArray[np.float64]:
        """Return values (R, C) on the cells of the raster of a grid; their sum is kept."""
        from rasterio.warp import Resampling, reproject

        found = np.zeros(grid.matrix)
        reproject(
            values, found, src_crs=self.crs, src_transform=self.transform, dst_crs=other.crs,
            dst_transform=other.transform, resampling=Resampling.sum,
        )  # fmt: skip
        return found


def geographic_raster(
    name: str, path: str
) -> tuple[tuple[float, float, float, float], NDArray[np.float64]]:
    """Return a GeoTIFF of probabilities on a grid of latitude and longitude.

    One of another reference system is resampled, and its sum is kept.

    Args:
        name: Name of the field that has it.
        path: The file.

    Returns:
        South, north, west and east in degrees, and (R, C) float64 with row 0 in the north; cells
        without data are 0.

    Raises:
        FieldError: If it cannot be read or has no probabilities, or rasterio is missing.
    """
    try:
        import rasterio
        from rasterio.warp import Resampling, calculate_default_transform, reproject
    except ModuleNotFoundError:
        raise FieldError(f"{name}: rasterio is missing; {pip_install('geotiff')}") from None
    allowed = f"{name} must be a GeoTIFF file of probabilities on the Earth, got {path!r}"
    try:
        with rasterio.open(path) as file:
            values = file.read(1, masked=True).filled(0).astype(np.float64)
            crs, transform, bounds = file.crs, file.transform, file.bounds
    except rasterio.errors.RasterioIOError as error:
        raise FieldError(f"{allowed}: {reason_of(error)}") from None
    values[np.isnan(values)] = 0.0
    if crs is None or not (np.isfinite(values).all() and values.min() >= 0 < values.sum()):
        raise FieldError(f"{allowed}: they must be finite, >= 0 and not all 0")
    a, b, _, d, e, _ = transform[:6]
    if not (crs.is_geographic and b == d == 0 and a > 0 > e):
        rows, cols = values.shape
        target = "EPSG:4326"
        on_earth, width, height = calculate_default_transform(crs, target, cols, rows, *bounds)
        resampled = np.zeros((height, width))
        reproject(
            values, resampled, src_crs=crs, src_transform=transform, dst_crs=target,
            dst_transform=on_earth, resampling=Resampling.sum,
        )  # fmt: skip
        values, transform = resampled, on_earth
    (west, east), (north, south) = _applied(
        transform, np.array([0, values.shape[1]]), np.array([0, values.shape[0]])
    ).tolist()
    return (south, north, west, east), values


def raster_of_grid(grid: GridShape, cell_size_m: float, origin: Origin) -> Raster:
    """Return the raster of a grid, row 0 in the north.

    x and y of the map frame are those of the orthographic projection of the ellipsoid about the
    origin, so the cells are exact rectangles of its plane. Above the ellipsoid, only the size of a
    cell in that plane changes.
    """
    from pymap3d.rcurve import meridian, transverse
    from rasterio.crs import CRS
    from rasterio.transform import Affine

    lat_deg, lon_deg, alt_m = origin
    across, down = (
        cell_size_m * radius_m / (radius_m + alt_m)
        for radius_m in (float(curvature(lat_deg)) for curvature in (transverse, meridian))
    )
    crs = CRS.from_dict(proj="ortho", lat_0=lat_deg, lon_0=lon_deg, datum="WGS84", units="m")
    return Raster(crs, Affine(across, 0, 0, 0, -down, grid.rows * down))


def _applied(transform: Any, x: Any, y: Any) -> NDArray[np.float64]:
    """Return points (2, N) by an affine transformation."""
    a, b, c, d, e, f = transform[:6]
    return np.array([a * x + b * y + c, d * x + e * y + f])


def _transformed(source: Any, target: Any, x: Any, y: Any) -> NDArray[np.float64]:
    """Return points (2, N) in another reference system, NaN where they are not on the Earth."""
    from rasterio.warp import transform

    try:
        return np.array(transform(source, target, x, y))
    # The errors of GDAL have no common base.
    except Exception:
        return np.full((2, len(x)), np.nan)

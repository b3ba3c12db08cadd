# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Matrices over the grid as GeoTIFF, by rasterio."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import rasterio
from numpy.typing import NDArray
from pymap3d.rcurve import meridian, transverse
from rasterio.crs import CRS
from rasterio.transform import Affine

from dsse_ros.scenario.frames import GridFrame


def write_geotiff(path: Path, frame: GridFrame, bands: Mapping[str, NDArray[np.float32]]) -> None:
    """Write matrices (G, G) with row 0 in the north as the bands of a GeoTIFF, by their names.

    x and y of the map frame are those of the orthographic projection of the ellipsoid about the
    origin, so the cells are exact rectangles of its plane. Above the ellipsoid, only the size of a
    cell in that plane changes.
    """
    lat_deg, lon_deg, alt_m = frame.origin_lat_deg, frame.origin_lon_deg, frame.origin_alt_m
    across, down = (
        frame.cell_size_m * radius_m / (radius_m + alt_m)
        for radius_m in (float(curvature(lat_deg)) for curvature in (transverse, meridian))
    )
    crs = CRS.from_dict(proj="ortho", lat_0=lat_deg, lon_0=lon_deg, datum="WGS84", units="m")
    try:
        with rasterio.open(
            path, "w", driver="GTiff", height=frame.grid_size, width=frame.grid_size,
            count=len(bands), dtype="float32", compress="deflate", interleave="band", crs=crs,
            transform=Affine(across, 0, 0, 0, -down, frame.grid_size * down),
        ) as raster:  # fmt: skip
            for number, (name, values) in enumerate(bands.items(), 1):
                raster.write(values, number)
                raster.set_band_description(number, name)
    except rasterio.errors.RasterioIOError as error:
        raise OSError(0, "cannot be written", str(path)) from error

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Matrices over the grid as GeoTIFF, by rasterio."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import rasterio
from numpy.typing import NDArray

from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.rasters import raster_of_grid


def write_geotiff(path: Path, frame: GridFrame, bands: Mapping[str, NDArray[np.float32]]) -> None:
    """Write matrices (R, C) with row 0 in the north as the bands of a GeoTIFF, by their names."""
    place = raster_of_grid(frame.grid_size, frame.cell_size_m, frame.origin)
    try:
        with rasterio.open(
            path, "w", driver="GTiff", height=frame.grid_size.rows,
            width=frame.grid_size.columns,
            count=len(bands), dtype="float32", compress="deflate", interleave="band", crs=place.crs,
            transform=place.transform,
        ) as raster:  # fmt: skip
            for number, (name, values) in enumerate(bands.items(), 1):
                raster.write(values, number)
                raster.set_band_description(number, name)
    except rasterio.errors.RasterioIOError as error:
        raise OSError(0, "cannot be written", str(path)) from error

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The strips that drones in metres have searched, as polygons on the Earth, by shapely."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import shapely
from numpy.typing import NDArray

from dsse_ros.world.scenario.frames import GridFrame, cell_to_map
from dsse_ros.world.scenario.geodesy import map_to_geodetic

Polygon = tuple[list[tuple[float, float]], ...]
"""Rings of (lon, lat) in degrees, each with its first point again at the end: the outer ring, then
those of the holes."""


def swept_polygons(
    frame: GridFrame, runs: Iterable[NDArray[np.float64]], width_m: float
) -> tuple[Polygon, ...]:
    """Return the strip about parts of a track.

    Args:
        runs: The parts, (M, 2) places (col, row) each.
    """
    lines = [np.stack(cell_to_map(frame, *run.T), axis=1) for run in runs]
    strip = shapely.MultiLineString(lines).buffer(width_m / 2, cap_style="flat")
    return tuple(
        tuple(_on_earth(frame, ring) for ring in (part.exterior, *part.interiors))
        for part in shapely.get_parts(strip)
        if not part.is_empty
    )


def _on_earth(frame: GridFrame, ring: shapely.LinearRing) -> list[tuple[float, float]]:
    east, north = shapely.get_coordinates(ring).T
    lat, lon, _ = map_to_geodetic(frame, east, north, 0.0)
    return list(zip(lon.tolist(), lat.tolist(), strict=True))

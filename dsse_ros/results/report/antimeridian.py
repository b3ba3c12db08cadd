# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tracks and polygons cut at the antimeridian, as GIS formats want them (RFC 7946, 3.1.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from dsse_ros.results.report.gis import GisPoint
from dsse_ros.results.report.swept import Polygon

EDGE_DEG = 180.0 - 1e-9
"""Longitude of the cut, 0.1 mm from the antimeridian: in GPX there is no 180."""


def cut_track(points: Sequence[GisPoint]) -> list[list[GisPoint]]:
    """Return the parts of a track, which end and begin where it crosses the antimeridian."""
    parts: list[list[GisPoint]] = [[]]
    for before, after in zip([None, *points], points, strict=False):
        if before is not None and abs(after.lon_deg - before.lon_deg) > 180:
            end, begin = _crossing(before, after)
            parts[-1].append(end)
            parts.append([begin])
        parts[-1].append(after)
    return parts


def _crossing(before: GisPoint, after: GisPoint) -> tuple[GisPoint, GisPoint]:
    """Return where a step of a track crosses the antimeridian, on either side of it."""
    side = 1.0 if before.lon_deg > 0 else -1.0
    share = (180 - side * before.lon_deg) / (360 + side * (after.lon_deg - before.lon_deg))
    lat, alt = (a + share * (b - a) for a, b in (
        (before.lat_deg, after.lat_deg), (before.alt_m, after.alt_m),
    ))  # fmt: skip
    time = None
    if before.time is not None and after.time is not None:
        time = before.time + share * (after.time - before.time)
    end = replace(before, lat_deg=lat, lon_deg=side * EDGE_DEG, alt_m=alt, time=time)
    return end, replace(end, lon_deg=-side * EDGE_DEG)


def cut_polygon(polygon: Polygon) -> list[Polygon]:
    """Return the parts of a polygon, less than half the Earth wide, on each side of the cut."""
    lons = np.array([lon for ring in polygon for lon, _ in ring])
    if np.ptp(lons) <= 180:
        return [polygon]
    outer, *holes = [[(lon % 360, lat) for lon, lat in ring] for ring in polygon]
    uncut = shapely.Polygon(outer, holes)
    found: list[Polygon] = []
    for west, east, turn in ((0.0, EDGE_DEG, 0.0), (360 - EDGE_DEG, 360.0, 360.0)):
        for part in shapely.get_parts(
            shapely.intersection(uncut, shapely.box(west, -90, east, 90))
        ):
            if part.geom_type == "Polygon":
                rings = (
                    shapely.get_coordinates(r) - (turn, 0) for r in (part.exterior, *part.interiors)
                )
                found.append(
                    tuple([(float(lon), float(lat)) for lon, lat in ring] for ring in rings)
                )
    return found

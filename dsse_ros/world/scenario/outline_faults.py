# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is wrong with the outlines of an area, and where."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from numbers import Real
from typing import Any

from dsse_ros.base.fields import shown

_PARTS = {
    "FeatureCollection": ("features", "feature"),
    "GeometryCollection": ("geometries", "geometry"),
    "MultiPolygon": ("coordinates", "polygon"),
}
"""Keys of the parts by type, and the word for one part."""
_LEAST_OF_RING = 4
_LEAST_OF_POINTS = 3


def fault_of(content: Any) -> str:
    """Return the first fault of GeoJSON, or of a list of points (latitude, longitude).

    Args:
        content: What is no area.

    Returns:
        One line that names the place and the value; "" if there is no fault of these kinds.
    """
    if not isinstance(content, Mapping):
        return _fault_of_points(content, "[lat, lon]", "", _LEAST_OF_POINTS)
    found = False
    for rings, where in _polygons(content, ""):
        found = True
        if not isinstance(rings, list) or not rings:
            return f"{where}coordinates must be a list of rings, got {shown(rings)}"
        for i, ring in enumerate(rings):
            of_ring = f"{where}ring {i}"
            fault = _fault_of_points(ring, "[lon, lat]", of_ring, _LEAST_OF_RING)
            if fault:
                return fault
            if ring[0] != ring[-1]:
                first, last = shown(ring[0]), shown(ring[-1])
                return f"{of_ring} must end at its first point, {first}, got {last}"
    return "" if found else f"it has no polygon, its type is {shown(content.get('type'))}"


def _polygons(geojson: Any, where: str) -> Iterator[tuple[Any, str]]:
    """Yield the coordinates of each polygon, and the words for its place."""
    if not isinstance(geojson, Mapping):
        return
    kind = geojson.get("type")
    if kind == "Feature":
        yield from _polygons(geojson.get("geometry"), where)
    elif kind == "Polygon":
        yield geojson.get("coordinates"), where
    else:
        name, of_part = _PARTS.get(str(kind), ("", ""))
        parts = geojson.get(name)
        for i, part in enumerate(parts if isinstance(parts, list) else ()):
            place = f"{where}{of_part} {i}, "
            if kind == "MultiPolygon":
                yield part, place
            else:
                yield from _polygons(part, place)


def _fault_of_points(points: Any, form: str, where: str, least: int) -> str:
    if not isinstance(points, list | tuple):
        return f"{where or 'it'} must be a list of points {form}, got {shown(points)}"
    for i, point in enumerate(points):
        is_pair = isinstance(point, list | tuple) and len(point) >= 2
        if not is_pair or not all(map(_is_finite, point)):
            place = f"{where}, point {i}" if where else f"point {i}"
            return f"{place} must be finite numbers {form}, got {shown(point)}"
    if len(points) < least:
        return f"{where or 'it'} must have {least} or more points, got {len(points)}"
    return ""


def _is_finite(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Grids on the plane of a projection, by pyproj."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

import numpy as np

from dsse_ros.base.extras import pip_install
from dsse_ros.world.drift.coordinates import Place, metres
from dsse_ros.world.drift.grids import (
    LOOKUP_M,
    Array,
    Grid,
    Lookup,
    elsewhere,
    lookup_axes,
    turn_of,
    window_of,
)
from dsse_ros.world.drift.netcdf import Unfit
from dsse_ros.world.drift.shore import Box

SAME_PLACE = 0.25
"""Share of a cell by which the places of a file may differ from those of its projection."""

_PROJECTIONS = ("proj4", "proj4_string", "crs_wkt", "spatial_ref")
"""Attributes with a whole projection; CF's own often lack the figure of the Earth."""
DATUM_DEG = 0.3
"""Degrees by which places may differ with the figure of the Earth, at most 0.2, and some cells."""
_FIGURES = {*_PROJECTIONS, "earth_radius", "semi_major_axis"}
_LOGGER = logging.getLogger(__name__)


def projected(place: Place, box: Box, margin: int) -> Grid | None:
    """Return the part of a projected grid that holds a box.

    Args:
        place: Its coordinates.
        box: The box.
        margin: Rows and columns around it.

    Returns:
        The part, or None if the latitudes and longitudes of the file differ from those of its
        projection, which does not state the figure of the Earth.

    Raises:
        Unfit: If the projection is unknown or contradicts the latitudes and longitudes of the file,
            or the grid holds nothing of the box.
    """
    y, x = (np.asarray(metres(axis), np.float64) for axis in (place.y, place.x))
    if min(len(y), len(x)) < 3 or not all(_is_monotonic(axis) for axis in (y, x)):
        raise Unfit(f"{place.y.name} and {place.x.name} must be axes of three or more values")
    plane = _plane(place.mapping)
    if not _is_of_projection(place, plane, y, x):
        return None
    lats, lons = lookup_axes(box, LOOKUP_M)
    px, py = plane.transform(*np.meshgrid(lons, lats))
    if plane.target_crs.is_geographic:
        # Longitudes of a rotated pole may exceed 180.
        middle = (x[0] + x[-1]) / 2
        px = middle + (px - middle + 180.0) % 360.0 - 180.0
    rows, cols = _fraction(y, np.asarray(py)), _fraction(x, np.asarray(px))
    inside = (rows >= 0) & (rows < len(y)) & (cols >= 0) & (cols < len(x))
    edge_x, edge_y = (
        np.concatenate([x, x, 0 * y + x[0], 0 * y + x[-1]]),
        np.concatenate([0 * x + y[0], 0 * x + y[-1], y, y]),
    )
    edge_lons, edge_lats = plane.transform(edge_x, edge_y, direction="INVERSE")
    if not inside.any():
        raise elsewhere(box, np.asarray(edge_lats), np.asarray(edge_lons))
    part = [
        window_of(values[inside], count, margin)
        for values, count in ((rows, len(y)), (cols, len(x)))
    ]
    xs, ys = np.meshgrid(x[slice(*part[1])], y[slice(*part[0])])
    part_lons, part_lats = plane.transform(xs, ys, direction="INVERSE")
    sides = float(np.sign(y[1] - y[0])), float(np.sign(x[1] - x[0]))
    return Grid(
        Lookup(lats, lons, rows - part[0][0], cols - part[1][0]),
        (np.arange(*part[0]), np.arange(*part[1])),
        np.asarray(edge_lats), np.asarray(edge_lons),
        turn=turn_of(np.asarray(part_lats), np.asarray(part_lons), sides),
    )  # fmt: skip


def _is_monotonic(axis: Array) -> bool:
    steps = np.diff(axis)
    return bool(np.isfinite(axis).all() and ((steps > 0).all() or (steps < 0).all()))


def _plane(mapping: Mapping[str, Any]) -> Any:
    """Return the `pyproj.Transformer` from longitude and latitude to the plane of a projection.

    Raises:
        Unfit: If the projection is unknown, or pyproj is missing.
    """
    try:
        from pyproj import CRS, Transformer
        from pyproj.exceptions import CRSError
    except ModuleNotFoundError:
        raise Unfit(f"pyproj is missing; {pip_install('drift')}") from None

    name = mapping.get("grid_mapping_name", "unknown")
    if "grid_north_pole_latitude" in mapping:
        # The text of a rotated pole is often that of the globe alone.
        mapping = {key: value for key, value in mapping.items() if key not in _PROJECTIONS}
    try:
        text = next(filter(None, map(mapping.get, _PROJECTIONS)), None)
        crs = CRS.from_cf(dict(mapping)) if text is None else CRS.from_user_input(str(text))
        crs = (crs.source_crs if crs.is_bound else None) or crs
        # Between coordinates of one datum: latitudes of a spherical model are used as they are.
        # The geodetic system of a rotated pole is itself.
        base = crs.source_crs
        if not crs.is_derived or base is None:
            raise ValueError(f"got {crs.name}, which projects and rotates nothing")
        return Transformer.from_crs(base, crs, always_xy=True)
    except (CRSError, KeyError, TypeError, ValueError) as error:
        raise Unfit(
            f"projection {name} must be one of CF: {' '.join(str(error).split())}"
        ) from None


def _is_of_projection(place: Place, plane: Any, y: Array, x: Array) -> bool:
    """Return whether a file's places are those of its projection, or it states their figure."""
    off, off_deg = (0.0, 0.0) if place.lat is None else _off(place, plane, y, x)
    if off_deg > DATUM_DEG:
        raise Unfit(
            f"{place.lat.name} and {place.lon.name} must be the places of their projection, got "
            f"{off:.1f} cells away from them"
        )
    if off > SAME_PLACE:
        if not _FIGURES & set(place.mapping):
            return False
        _LOGGER.warning(
            "%s and %s are up to %.1f cells from the places of their projection, which is used",
            place.lat.name, place.lon.name, off,
        )  # fmt: skip
    return True


def _off(place: Place, plane: Any, y: Array, x: Array) -> tuple[float, float]:
    """Return how far latitudes and longitudes of a file are from its projection.

    Returns:
        Cells and degrees of a great circle, the most of nine places.
    """
    some = {
        dim: [0, count // 2, count - 1]
        for dim, count in zip(place.dims, (len(y), len(x)), strict=True)
    }
    lat, lon = (
        np.asarray(coordinate.isel(some).transpose(*place.dims).values, np.float64)
        for coordinate in (place.lat, place.lon)
    )
    rows, cols = some.values()
    wanted_lon, wanted_lat = plane.transform(*np.meshgrid(x[cols], y[rows]), direction="INVERSE")
    east = (wanted_lon - lon + 180.0) % 360.0 - 180.0
    off_deg = np.hypot(wanted_lat - lat, east * np.cos(np.radians(lat)))
    px, py = plane.transform(lon, lat)
    if plane.target_crs.is_geographic:
        px = x[cols] + (px - x[cols] + 180.0) % 360.0 - 180.0
    off = np.hypot(
        _fraction(y, np.asarray(py)) - np.array(rows)[:, None],
        _fraction(x, np.asarray(px)) - np.array(cols)[None, :],
    )
    return float(np.nanmax(off, initial=0.0)), float(np.nanmax(off_deg, initial=0.0))


def _fraction(axis: Array, values: Array) -> Array:
    """Return the position of values on an axis as a fraction of an index, also beyond its ends."""
    last = len(axis) - 1
    if axis[0] > axis[-1]:
        return last - _fraction(axis[::-1], values)
    found = np.interp(values, axis, np.arange(len(axis), dtype=np.float64))
    found = np.where(values < axis[0], (values - axis[0]) / (axis[1] - axis[0]), found)
    after = last + (values - axis[-1]) / (axis[-1] - axis[-2])
    found = np.where(values > axis[-1], after, found)
    return np.where(np.isfinite(values), found, np.nan)

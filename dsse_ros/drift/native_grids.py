# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Grids that are not of latitude and longitude: projected and curvilinear ones.

Velocities stay at the points of their grid. A lookup on a regular grid of latitude and longitude
gives the row and the column of a place. It is smooth, so that little is lost between its points.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.drift.coordinates import Place, metres
from dsse_ros.drift.kernels import degrees_per_metre
from dsse_ros.drift.netcdf import MAX_AT_ONCE, Unfit, filled
from dsse_ros.drift.shore import Box
from dsse_ros.extras import pip_install

LOOKUP_M = 2000.0
"""Greatest distance of the points of a lookup; in curvilinear grids, half of a cell if less."""
MAX_LOOKUP = 400
"""Points of a side of a lookup at most."""
MAX_TRIANGULATED = 100_000
"""Points of a curvilinear grid whose rows and columns are interpolated, at most; of more, some."""
SAME_PLACE = 0.25
"""Share of a cell by which two coordinates of one point may differ."""

_PROJECTIONS = ("proj4", "proj4_string", "crs_wkt", "spatial_ref")
"""Attributes with a whole projection; CF's own often lack the figure of the Earth."""
_FIGURES = {*_PROJECTIONS, "earth_radius", "semi_major_axis"}
_LOGGER = logging.getLogger(__name__)

Array = NDArray[np.float64]
Shifts = tuple[tuple[int, int], ...]
"""Rows and columns from a point to the values of a component whose mean it has."""

_HERE: Shifts = ((0, 0),)
_STAGGERED: tuple[Shifts, Shifts] = ((1, 0), (1, 1)), ((0, 1), (1, 1))
_LAYOUTS: tuple[tuple[Shifts, Shifts], ...] = (
    (_HERE, _HERE),
    _STAGGERED,
    (((0, 0), (0, 1)), ((0, 0), (1, 0))),
)
"""Where a grid has its components: both at one point, or on the sides of a cell (Arakawa C): half a
cell after its centre, as ROMS and NEMO have it, or before it."""


class Lookup(NamedTuple):
    """Rows and columns of places.

    Attributes:
        lats_deg: (Y,) increasing latitudes.
        lons_deg: (X,) increasing longitudes.
        rows: (Y, X) row of the place, as a fraction; NaN off the grid.
        cols: (Y, X) its column.
    """

    lats_deg: Array
    lons_deg: Array
    rows: Array
    cols: Array


class NativeGrid(NamedTuple):
    """A part of a grid of J rows and I columns.

    Attributes:
        lookup: Its places, in rows and columns of the part.
        rows: First row of the part in the file, and the one after the last.
        cols: The same for columns.
        shifts: See `Shifts`, for each component.
        turn: (J, I) angle from east to the direction of the columns' axis, anticlockwise, radians.
        lats_deg: Some latitudes of the whole file, its extremes among them.
        lons_deg: The same of longitudes.
    """

    lookup: Lookup
    rows: tuple[int, int]
    cols: tuple[int, int]
    shifts: tuple[Shifts, Shifts]
    turn: Array
    lats_deg: Array
    lons_deg: Array


def projected(place: Place, box: Box, margin: int) -> NativeGrid | None:
    """Return the part of a projected grid that holds a box.

    Args:
        place: Its coordinates.
        box: The box.
        margin: Rows and columns around it.

    Returns:
        The part, or None if the latitudes and longitudes of the file contradict its projection,
        which does not state the figure of the Earth.

    Raises:
        Unfit: If the projection is unknown, or the grid holds nothing of the box.
    """
    y, x = (np.asarray(metres(axis), np.float64) for axis in (place.y, place.x))
    if min(len(y), len(x)) < 3 or not all(_is_monotonic(axis) for axis in (y, x)):
        raise Unfit(f"{place.y.name} and {place.x.name} must be axes of three or more values")
    plane = _plane(place.mapping)
    off = 0.0 if place.lat is None else _cells_off(place, plane, y, x)
    if off > SAME_PLACE:
        if not _FIGURES & set(place.mapping):
            return None
        _LOGGER.warning(
            "%s and %s are up to %.1f cells from the places of their projection, which counts",
            place.lat.name, place.lon.name, off,
        )  # fmt: skip
    lats, lons = lookup_axes(box, LOOKUP_M)
    px, py = plane.transform(*np.meshgrid(lons, lats))
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
        _window(values[inside], count, margin) for values, count in ((rows, len(y)), (cols, len(x)))
    ]
    xs, ys = np.meshgrid(x[slice(*part[1])], y[slice(*part[0])])
    part_lons, part_lats = plane.transform(xs, ys, direction="INVERSE")
    sides = float(np.sign(y[1] - y[0])), float(np.sign(x[1] - x[0]))
    return NativeGrid(
        Lookup(lats, lons, rows - part[0][0], cols - part[1][0]), part[0], part[1],
        (_HERE, _HERE), _turn(np.asarray(part_lats), np.asarray(part_lons), sides),
        np.asarray(edge_lats), np.asarray(edge_lons),
    )  # fmt: skip


def curvilinear(dataset: Any, places: tuple[Place, Place], box: Box, margin: int) -> NativeGrid:
    """Return the part of a curvilinear grid that holds a box.

    Args:
        dataset: The file.
        places: Coordinates of the two components.
        box: The box.
        margin: Rows and columns around it.

    Raises:
        Unfit: If its coordinates are not understood, or the grid holds nothing of the box.
    """
    shifts, lat, lon = _centres(dataset, places)
    turned = box.turned(lon)
    inside = (lat >= box.south_deg) & (lat <= box.north_deg)
    inside &= (turned >= box.west_deg) & (turned <= box.east_deg)
    if not inside.any():
        # The box may be smaller than a cell.
        away = np.hypot(lat - box.middle_deg[0], turned - box.middle_deg[1])
        inside.ravel()[np.nanargmin(away)] = True
    part = []
    for axis, count in enumerate(lat.shape):
        index = np.flatnonzero(inside.any(axis=1 - axis))
        if len(index) and np.diff(index, prepend=index[0]).max() > count // 3 > 2:
            raise Unfit("grid must not have its seam in the area needed")
        part.append(_window(index, count, margin + 1))
    window = slice(*part[0]), slice(*part[1])
    lookup = _triangulated(lat[window], turned[window], box)
    if not np.isfinite(lookup.rows).any():
        raise elsewhere(box, lat, lon)
    turn = _turn(lat[window], turned[window], None)
    return NativeGrid(lookup, part[0], part[1], shifts, turn, lat, lon)


def elsewhere(box: Box, lats: Array, lons: Array) -> Unfit:
    """Return the refusal of a file that covers other places."""
    ends = (np.nanmin(lats), np.nanmax(lats), np.nanmin(lons), np.nanmax(lons))
    south, north, west, east = (f"{end:.4f}" for end in ends)
    return Unfit(
        f"file must cover latitude within {box.south_deg:.4f} to {box.north_deg:.4f} and longitude "
        f"within {box.west_deg:.4f} to {box.east_deg:.4f}, got {south} to {north} and {west} to "
        f"{east}"
    )


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

    try:
        text = next(filter(None, map(mapping.get, _PROJECTIONS)), None)
        crs = CRS.from_cf(dict(mapping)) if text is None else CRS.from_user_input(str(text))
        # Between coordinates of one datum: latitudes of a spherical model are used as they are.
        return Transformer.from_crs(crs.geodetic_crs, crs, always_xy=True)
    except (CRSError, KeyError, TypeError, ValueError) as error:
        name = mapping.get("grid_mapping_name", "unknown")
        raise Unfit(
            f"projection {name} must be one of CF: {' '.join(str(error).split())}"
        ) from None


def _cells_off(place: Place, plane: Any, y: Array, x: Array) -> float:
    """Return how far latitudes and longitudes of a file are from those of its projection."""
    counts = zip(place.dims, (len(y), len(x)), strict=True)
    some = {dim: [0, count // 2, count - 1] for dim, count in counts}
    lat, lon = (
        np.asarray(one.isel(some).transpose(*place.dims).values, np.float64)
        for one in (place.lat, place.lon)
    )
    px, py = plane.transform(lon, lat)
    rows = np.abs(_fraction(y, np.asarray(py)) - np.array(some[place.dims[0]])[:, None])
    cols = np.abs(_fraction(x, np.asarray(px)) - np.array(some[place.dims[1]])[None, :])
    return float(np.nanmax(np.hypot(rows, cols), initial=0.0))


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


def _window(index: NDArray[Any], count: int, margin: int) -> tuple[int, int]:
    """Return first and one after last of three or more indices around some of an axis."""
    first = max(math.floor(index.min()) - margin, 0)
    last = min(math.ceil(index.max()) + margin, count - 1)
    return max(min(first, last - 2), 0), max(last, min(first + 2, count - 1)) + 1


def lookup_axes(box: Box, spacing_m: float) -> tuple[Array, Array]:
    """Return latitudes and longitudes of the points of a lookup of a box."""
    scales = degrees_per_metre(box.middle_deg[0])
    sides = (box.south_deg, box.north_deg), (box.west_deg, box.east_deg)
    lats, lons = (
        np.linspace(low, high, int(np.clip((high - low) / scale / spacing_m + 2, 2, MAX_LOOKUP)))
        for (low, high), scale in zip(sides, scales, strict=True)
    )
    return lats, lons


def _units(lat: Array, lon: Array) -> tuple[Array, Array, Array]:
    """Return unit vectors (..., 3) of places on a sphere, and of east and north there."""
    phi, lam = np.radians(lat), np.radians(lon)
    up = np.stack([np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)], axis=-1)
    east = np.stack([-np.sin(lam), np.cos(lam), 0 * lam], axis=-1)
    return up, east, np.cross(up, east)


def _turn(lat: Array, lon: Array, sides: tuple[float, float] | None) -> Array:
    """Return the angle of a grid, see `NativeGrid`.

    It is the rotation nearest to the directions of both axes, which neither the flattening of the
    Earth nor grids that are not quite orthogonal distort.

    Args:
        lat: (J, I).
        lon: (J, I).
        sides: Signs of the axes of rows and columns; None for those that make north lie left of
            east.
    """
    up, east, north = _units(lat, lon)
    along = []
    for axis in (0, 1):
        step = np.gradient(up, axis=axis, edge_order=2)
        part = np.stack([(step * east).sum(axis=-1), (step * north).sum(axis=-1)])
        along.append(part / np.hypot(*part))
    rows, cols = along
    if sides is None:
        handed = np.nanmedian(cols[0] * rows[1] - cols[1] * rows[0])
        sides = (float(np.sign(handed)), 1.0)
    rows, cols = sides[0] * rows, sides[1] * cols
    return np.asarray(np.arctan2(cols[1] - rows[0], cols[0] + rows[1]))


def _triangulated(lat: Array, lon: Array, box: Box) -> Lookup:
    """Return the lookup of a curvilinear grid, linear in triangles between its points."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import QhullError

    scales = degrees_per_metre(box.middle_deg[0])
    sides = [np.hypot(np.diff(lat, axis=a) / scales[0], np.diff(lon, axis=a) / scales[1])
             for a in (0, 1)]  # fmt: skip
    cell_m = float(min(np.nanmedian(side) for side in sides))
    lats, lons = lookup_axes(box, min(LOOKUP_M, max(cell_m / 2, 1.0)))
    stride = math.ceil(math.sqrt(lat.size / MAX_TRIANGULATED))
    rows, cols = (
        np.unique(np.append(np.arange(0, count, stride), count - 1)) for count in lat.shape
    )
    some = np.ix_(rows, cols)
    index = np.stack(np.meshgrid(rows, cols, indexing="ij"), axis=-1).reshape(-1, 2)
    places = np.stack([lat[some].ravel() / scales[0], lon[some].ravel() / scales[1]], axis=-1)
    known = np.isfinite(places).all(axis=1)
    try:
        # Metres from the middle keep the digits that the triangulation needs.
        middle = places[known].mean(axis=0)
        at = LinearNDInterpolator(places[known] - middle, index[known].astype(np.float64))
    except (QhullError, ValueError):
        raise Unfit("grid must have latitudes and longitudes that differ") from None
    wanted = np.stack(np.meshgrid(lats / scales[0], lons / scales[1], indexing="ij"), axis=-1)
    found = at(wanted - middle)
    return Lookup(lats, lons, found[..., 0].copy(), found[..., 1].copy())


def _centres(
    dataset: Any, places: tuple[Place, Place]
) -> tuple[tuple[Shifts, Shifts], Array, Array]:
    """Return where a grid has its components, and latitudes and longitudes of its points.

    Raises:
        Unfit: If the coordinates do not state it.
    """
    known = [_coordinates(place) for place in places]
    if any(one is None for one in known):
        return _at_rho_points(dataset, places)
    for layout in _LAYOUTS:
        means = [_mean(*one, shifts) for one, shifts in zip(known, layout, strict=True) if one]
        rows, cols = (min(one[0].shape[axis] for one in means) for axis in (0, 1))
        if min(rows, cols) < 3:
            continue
        (lat, lon), (other_lat, other_lon) = (
            (one[0][:rows, :cols], one[1][:rows, :cols]) for one in means
        )
        cell = np.nanmedian(np.abs(np.diff(lat, axis=0))) + np.nanmedian(
            np.abs(np.diff(lat, axis=1))
        )
        turn = (other_lon - lon + 180.0) % 360.0 - 180.0
        off = np.hypot(other_lat - lat, turn * np.cos(np.radians(lat)))
        if np.nanmedian(off) < SAME_PLACE * cell:
            return layout, lat, lon
    raise Unfit("components must be at one point of the grid, or on the sides of its cells")


def _coordinates(place: Place) -> tuple[Array, Array] | None:
    """Return latitudes and longitudes (J, I), or None if those of the file are of no use.

    Raises:
        Unfit: If they are too many.
    """
    if place.lat is None:
        return None
    if math.prod(place.lat.sizes.values()) > MAX_AT_ONCE:
        raise Unfit(f"{place.lat.name} must have at most {MAX_AT_ONCE} values")
    if place.lat.ndim == 1:
        lon, lat = np.meshgrid(place.lon.values, place.lat.values)
    else:
        lat, lon = (one.transpose(*place.dims).values for one in (place.lat, place.lon))
    lat, lon = filled(lat), filled(lon)
    on_earth = (np.abs(lat) <= 90) & (np.abs(lon) <= 720)
    lat, lon = np.where(on_earth, lat, np.nan), np.where(on_earth, lon, np.nan)
    if not on_earth.any() or np.nanmax(lat) == np.nanmin(lat) or np.nanmax(lon) == np.nanmin(lon):
        return None
    return lat, lon


def _mean(lat: Array, lon: Array, shifts: Shifts) -> tuple[Array, Array]:
    """Return the mean latitudes and longitudes of points with these shifts."""
    first, last = (shifted(lat, shifts[number]) for number in (0, -1))
    west, east = (shifted(lon, shifts[number]) for number in (0, -1))
    rows, cols = (min(a, b) for a, b in zip(first.shape, last.shape, strict=True))
    part = np.s_[:rows, :cols]
    turn = (east[part] - west[part] + 180.0) % 360.0 - 180.0
    return (first[part] + last[part]) / 2, west[part] + turn / 2


def shifted(values: NDArray[Any], shift: tuple[int, int]) -> NDArray[Any]:
    """Return values (..., J, I) from a row and a column on."""
    return values[..., shift[0] :, shift[1] :]


def _at_rho_points(
    dataset: Any, places: tuple[Place, Place]
) -> tuple[tuple[Shifts, Shifts], Array, Array]:
    """Return `_centres` of a file of ROMS whose coordinates of the components are of no use.

    Raises:
        Unfit: If it has no coordinates of its rho points.
    """
    names = [name for name in ("lat_rho", "lon_rho") if name in dataset.variables]
    rho = None
    if len(names) == 2:
        rho = _coordinates(Place(*(dataset[name] for name in names)))
    dims = " ".join(dim for place in places for dim in place.dims)
    if rho is None or "_u" not in dims or "_v" not in dims:
        raise Unfit("components must have latitudes and longitudes that differ")
    lat, lon = rho
    rows, cols = (min(dataset.sizes[place.dims[axis]] for place in places) - 1 for axis in (0, 1))
    part = np.s_[1 : rows + 1, 1 : cols + 1]
    return _STAGGERED, lat[part], lon[part]

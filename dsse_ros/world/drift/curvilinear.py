# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Curvilinear grids, which have the latitude and the longitude of each of their points.

The coordinates of a large grid are read in blocks; only those around the area are kept.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.world.drift.coordinates import Place
from dsse_ros.world.drift.grids import (
    HERE,
    LOOKUP_M,
    Array,
    Grid,
    Lookup,
    Shifts,
    elsewhere,
    lookup_axes,
    turn_of,
    window_of,
)
from dsse_ros.world.drift.kernels import degrees_per_metre
from dsse_ros.world.drift.netcdf import MAX_AT_ONCE, Unfit, filled
from dsse_ros.world.drift.shore import Box

BLOCK = 1 << 20
"""Points whose coordinates are read at once."""
MAX_TRIANGULATED = 100_000
"""Points of a curvilinear grid whose rows and columns are interpolated, at most; of more, some."""
SAME_PLACE = 0.25
"""Share of a cell by which two coordinates of one point may differ."""

_STAGGERED: tuple[Shifts, Shifts] = ((1, 0), (1, 1)), ((0, 1), (1, 1))
_LAYOUTS: tuple[tuple[Shifts, Shifts], ...] = (
    (HERE, HERE),
    _STAGGERED,
    (((0, 0), (0, 1)), ((0, 0), (1, 0))),
)
"""Where a grid has its components: both at one point, or on the sides of a cell (Arakawa C): half a
cell after its centre, as ROMS and NEMO have it, or before it."""


class _Seen(NamedTuple):
    """Where a grid has a box.

    Attributes:
        rows: (J,) bool, rows with a point in the box or, without any, next to it.
        cols: (I,) bool, the same of columns.
        lats_deg: Least and greatest latitude of the grid.
        lons_deg: Least and greatest longitude.
    """

    rows: NDArray[np.bool_]
    cols: NDArray[np.bool_]
    lats_deg: Array
    lons_deg: Array


def curvilinear(dataset: Any, places: tuple[Place, Place], box: Box, margin: int) -> Grid:
    """Return the part of a curvilinear grid that holds a box.

    Args:
        dataset: The file.
        places: Coordinates of the two components.
        box: The box.
        margin: Rows and columns around it.

    Raises:
        Unfit: If its coordinates are not understood, or the grid holds nothing of the box.
    """
    known = [place for place in (places[0], _rho_place(dataset)) if place and place.lat is not None]
    seen = next(filter(None, (_seen(place, box) for place in known)), None)
    if seen is None:
        raise _no_places()
    window = []
    for flags in seen[:2]:
        index, count = np.flatnonzero(flags), len(flags)
        if np.diff(index, prepend=index[0]).max() > count // 3 > 2:
            raise Unfit("grid must not have its seam in the area needed")
        # Beside the margin: components on the sides of cells, and a point for the directions.
        window.append(slice(*window_of(index, count, margin + 3)))
    size = math.prod(part.stop - part.start for part in window)
    if size > MAX_AT_ONCE:
        raise Unfit(f"grid must have at most {MAX_AT_ONCE} points in the area, got {size}")
    shifts, lat, lon = _centres(dataset, places, (window[0], window[1]))
    lon = box.turned(lon)
    lookup = _triangulated(lat, lon, box)
    if not np.isfinite(lookup.rows).any():
        raise elsewhere(box, seen.lats_deg, seen.lons_deg)
    rows, cols = (
        part.start + np.arange(count) for part, count in zip(window, lat.shape, strict=True)
    )
    turn = turn_of(lat, lon, None)
    return Grid(lookup, (rows, cols), seen.lats_deg, seen.lons_deg, shifts, turn)


def _no_places() -> Unfit:
    return Unfit("components must have latitudes and longitudes that differ")


def _rho_place(dataset: Any) -> Place | None:
    """Return the coordinates of the rho points of ROMS, None of another file."""
    if "lat_rho" in dataset.variables and "lon_rho" in dataset.variables:
        return Place(dataset["lat_rho"], dataset["lon_rho"])
    return None


def _seen(place: Place, box: Box) -> _Seen | None:
    """Return where a grid has a box; None if all of its points have one place."""
    sizes = {**place.lat.sizes, **place.lon.sizes}
    shape = tuple(sizes[dim] for dim in place.dims)
    rows, cols = np.zeros(shape[0], np.bool_), np.zeros(shape[1], np.bool_)
    nearest, at, ends = np.inf, (0, 0), np.array([[np.inf, -np.inf], [np.inf, -np.inf]])
    step = max(BLOCK // shape[1], 1)
    for first in range(0, shape[0], step):
        lat, lon = _coordinates(place, (slice(first, first + step), slice(None)))
        if not np.isfinite(lat).any():
            continue
        ends[:, 0] = np.minimum(ends[:, 0], [np.nanmin(lat), np.nanmin(lon)])
        ends[:, 1] = np.maximum(ends[:, 1], [np.nanmax(lat), np.nanmax(lon)])
        turned = box.turned(lon)
        inside = (lat >= box.south_deg) & (lat <= box.north_deg)
        inside &= (turned >= box.west_deg) & (turned <= box.east_deg)
        rows[first : first + step] = inside.any(axis=1)
        cols |= inside.any(axis=0)
        away = np.hypot(lat - box.middle_deg[0], turned - box.middle_deg[1])
        if np.nanmin(away) < nearest:
            nearest, flat = float(np.nanmin(away)), int(np.nanargmin(away))
            at = first + flat // shape[1], flat % shape[1]
    if not (ends[:, 0] < ends[:, 1]).all():
        return None
    # The box may be smaller than a cell.
    if not rows.any():
        rows[at[0]] = cols[at[1]] = True
    return _Seen(rows, cols, ends[0], ends[1])


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
    dataset: Any, places: tuple[Place, Place], window: tuple[slice, slice]
) -> tuple[tuple[Shifts, Shifts], Array, Array]:
    """Return where a part of a grid has its components, and latitudes and longitudes there.

    Args:
        dataset: The file.
        places: Coordinates of the components.
        window: Rows and columns of the part.
    """
    known = [_coordinates(place, window) for place in places if place.lat is not None]
    if len(known) < 2 or not all(_differ(*pair) for pair in known):
        return _at_rho_points(dataset, places, window)
    for layout in _LAYOUTS:
        means = [_mean(*pair, shifts) for pair, shifts in zip(known, layout, strict=True)]
        rows, cols = (min(mean[0].shape[axis] for mean in means) for axis in (0, 1))
        if min(rows, cols) < 3:
            continue
        (lat, lon), (other_lat, other_lon) = (
            (mean[0][:rows, :cols], mean[1][:rows, :cols]) for mean in means
        )
        cell = np.nanmedian(np.abs(np.diff(lat, axis=0))) + np.nanmedian(
            np.abs(np.diff(lat, axis=1))
        )
        turn = (other_lon - lon + 180.0) % 360.0 - 180.0
        off = np.hypot(other_lat - lat, turn * np.cos(np.radians(lat)))
        if np.nanmedian(off) < SAME_PLACE * cell:
            return layout, lat, lon
    raise Unfit("components must be at one point of the grid, or on the sides of its cells")


def _coordinates(place: Place, window: tuple[slice, slice]) -> tuple[Array, Array]:
    """Return latitudes and longitudes (J, I) of a part of a grid, NaN off the Earth."""
    lat, lon = place.lat, place.lon
    if lat.ndim == 1:
        import xarray

        lat, lon = xarray.broadcast(lat, lon)
    part = dict(zip(place.dims, window, strict=True))
    lat, lon = (filled(axis.isel(part).transpose(*place.dims).values) for axis in (lat, lon))
    on_earth = (np.abs(lat) <= 90) & (np.abs(lon) <= 720)
    return np.where(on_earth, lat, np.nan), np.where(on_earth, lon, np.nan)


def _differ(lat: Array, lon: Array) -> bool:
    known = np.isfinite(lat)
    return bool(known.any() and np.ptp(lat[known]) > 0 and np.ptp(lon[known]) > 0)


def _mean(lat: Array, lon: Array, shifts: Shifts) -> tuple[Array, Array]:
    """Return the mean latitudes and longitudes of points with these shifts."""
    (first, west), (last, east) = (
        (lat[row:, col:], lon[row:, col:]) for row, col in (shifts[0], shifts[-1])
    )
    rows, cols = (min(a, b) for a, b in zip(first.shape, last.shape, strict=True))
    part = np.s_[:rows, :cols]
    turn = (east[part] - west[part] + 180.0) % 360.0 - 180.0
    return (first[part] + last[part]) / 2, west[part] + turn / 2


def _at_rho_points(
    dataset: Any, places: tuple[Place, Place], window: tuple[slice, slice]
) -> tuple[tuple[Shifts, Shifts], Array, Array]:
    """Return `_centres` of a ROMS file that lacks usable coordinates of the components."""
    rho = _rho_place(dataset)
    dims = " ".join(dim for place in places for dim in place.dims)
    if rho is None or "_u" not in dims or "_v" not in dims:
        raise _no_places()
    lat, lon = _coordinates(rho, window)
    rows, cols = (
        min(min(part.stop, dataset.sizes[place.dims[axis]]) for place in places) - part.start - 1
        for axis, part in enumerate(window)
    )
    part = np.s_[1 : rows + 1, 1 : cols + 1]
    return _STAGGERED, lat[part], lon[part]

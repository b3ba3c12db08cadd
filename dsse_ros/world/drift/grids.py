# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The part of a grid that is read, its places and its directions.

Velocities stay at the points of their grid. A lookup on a regular grid of latitude and longitude
gives the row and the column of a place. It is smooth, so that little is lost between its points.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.world.drift.kernels import degrees_per_metre
from dsse_ros.world.drift.netcdf import Unfit
from dsse_ros.world.drift.shore import Box

LOOKUP_M = 2000.0
"""Greatest distance of the points of a lookup; in curvilinear grids, half of a cell if less."""
MAX_LOOKUP = 400
"""Points of a side of a lookup at most."""

Array = NDArray[np.float64]
Shifts = tuple[tuple[int, int], ...]
"""Rows and columns from a point to the values of a component whose mean it has."""
HERE: Shifts = ((0, 0),)


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


class Mesh(NamedTuple):
    """The part of a mesh in an area, and its places on a regular grid.

    Attributes:
        points: (N,) indices in the file, increasing.
        lats_deg: (Y,) latitudes of the grid.
        lons_deg: (X,) longitudes of the grid.
        corners: (Y, X, 3) numbers among `points`.
        weights: (Y, X, 3) weights of the corners; NaN off the mesh.
        all_lats_deg: Latitudes of the whole file.
        all_lons_deg: Its longitudes.
    """

    points: NDArray[np.int64]
    lats_deg: Array
    lons_deg: Array
    corners: NDArray[np.int64]
    weights: Array
    all_lats_deg: Array
    all_lons_deg: Array

    def resampled(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return values (N,) at the points as values (Y, X) on the grid."""
        return (values[self.corners] * self.weights).sum(axis=-1).astype(np.float32)


class Grid(NamedTuple):
    """The part of a grid, of J rows and I columns, that is read.

    Attributes:
        lookup: Places on it; without rows and columns on a grid of latitude and longitude.
        indices: (J,) rows and (I,) columns in the file.
        lats_deg: Latitudes of the whole file, its extremes among them.
        lons_deg: The same of longitudes.
        shifts: See `Shifts`, for each component.
        turn: (J, I) angle from east to the direction of the columns' axis, anticlockwise, radians;
            None for axes to the east and north.
        mesh: Where the points of a mesh lie on the grid, None without a mesh.
    """

    lookup: Lookup
    indices: tuple[NDArray[np.int64], NDArray[np.int64]]
    lats_deg: Array
    lons_deg: Array
    shifts: tuple[Shifts, Shifts] = (HERE, HERE)
    turn: Array | None = None
    mesh: Mesh | None = None


def elsewhere(box: Box, lats: Array, lons: Array) -> Unfit:
    """Return the error for a file that covers another area."""
    ends = (np.nanmin(lats), np.nanmax(lats), np.nanmin(lons), np.nanmax(lons))
    south, north, west, east = (f"{end:.4f}" for end in ends)
    return Unfit(
        f"file must cover latitude within {box.south_deg:.4f} to {box.north_deg:.4f} and longitude "
        f"within {box.west_deg:.4f} to {box.east_deg:.4f}, got {south} to {north} and {west} to "
        f"{east}"
    )


def lookup_axes(box: Box, spacing_m: float) -> tuple[Array, Array]:
    """Return latitudes and longitudes of the points of a lookup of a box."""
    scales = degrees_per_metre(box.middle_deg[0])
    sides = (box.south_deg, box.north_deg), (box.west_deg, box.east_deg)
    lats, lons = (
        np.linspace(low, high, int(np.clip((high - low) / scale / spacing_m + 2, 2, MAX_LOOKUP)))
        for (low, high), scale in zip(sides, scales, strict=True)
    )
    return lats, lons


def window_of(index: NDArray[Any], count: int, margin: int) -> tuple[int, int]:
    """Return the first of three or more indices around some of an axis, and one after the last."""
    first = max(math.floor(index.min()) - margin, 0)
    last = min(math.ceil(index.max()) + margin, count - 1)
    return max(min(first, last - 2), 0), max(last, min(first + 2, count - 1)) + 1


def turn_of(lat: Array, lon: Array, sides: tuple[float, float] | None) -> Array:
    """Return the angle of a grid, see `Grid`.

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


def _units(lat: Array, lon: Array) -> tuple[Array, Array, Array]:
    """Return unit vectors (..., 3) of places on a sphere, and of east and north there."""
    phi, lam = np.radians(lat), np.radians(lon)
    up = np.stack([np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)], axis=-1)
    east = np.stack([-np.sin(lam), np.cos(lam), 0 * lam], axis=-1)
    return up, east, np.cross(up, east)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Metres on the grid to WGS84 and back: ENU at its south-west corner through ECEF, by pymap3d.

x and y are those of ENU, exact where flat-Earth formulas are off by metres within a few kilometres.
z is the height above the sea at the place itself, as altimeters and autopilots have it: the tangent
plane at the origin is 196 m above the ellipsoid 50 km away.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import pymap3d
from numpy.typing import NDArray

from dsse_ros.world.scenario.frames import F, GridFrame, cell_to_map, flip_y

_SURFACE_M = 1e-6
"""Tolerance of the height above the surface."""
_MAX_TURNS = 20
_METRES_PER_DEGREE = 111_195.0
_NEAR_SIDE_M = -6e6
"""Seen from the origin, the far side of the Earth has the same x and y once more."""

Origin = tuple[float, float, float]
"""Latitude and longitude in degrees and height above the ellipsoid in metres."""


def surface_to_geodetic(origin: Origin, x_m: Any, y_m: Any) -> tuple[Any, Any]:
    """Return latitude and longitude in degrees of points on the surface through the origin.

    Args:
        origin: The point (0, 0), and the height of the surface above the ellipsoid.
        x_m: Metres east, a number or an array.
        y_m: Metres north.
    """
    # The surface curves away from the plane; two or three iterations find its point below (x, y).
    up_m = np.zeros(np.broadcast_shapes(np.shape(x_m), np.shape(y_m)))
    for _ in range(_MAX_TURNS):
        lat_deg, lon_deg, alt_m = through_ecef(pymap3d.enu2geodetic, origin, x_m, y_m, up_m)
        above_m = np.asarray(alt_m) - origin[2]
        if not np.any(np.abs(above_m) > _SURFACE_M):
            break
        up_m = up_m - above_m
    return lat_deg, lon_deg


def through_ecef(
    convert: Callable[..., tuple[Any, Any, Any]], origin: Origin, *point: Any
) -> tuple[Any, Any, Any]:
    """Convert a point, given as numbers or arrays, with a function of pymap3d."""
    # pymap3d does not broadcast, and its results differ in type between scalars and arrays.
    arrays = np.broadcast_arrays(*(np.asarray(value, dtype=np.float64) for value in point))
    converted = convert(*(np.atleast_1d(array) for array in arrays), *origin)
    if arrays[0].ndim == 0:
        first, second, third = (float(array[0]) for array in converted)
        return first, second, third
    return converted


def mean_lon(lons: NDArray[np.float64]) -> float:
    """Return the mean of longitudes that may be on both sides of the antimeridian."""
    first = float(lons[0])
    mean = first + float(((lons - first + 180) % 360 - 180).mean())
    return (mean + 180) % 360 - 180


def map_to_geodetic(frame: GridFrame, x_m: F, y_m: F, z_m: float | F) -> tuple[F, F, F]:
    """Return latitude and longitude in degrees and height above the ellipsoid in metres.

    Args:
        frame: The grid; its origin is the point (0, 0, 0).
        x_m: Metres east, a number or an array.
        y_m: Metres north.
        z_m: Metres above the surface that is as high above the ellipsoid as the origin.
    """
    x, y, z = np.broadcast_arrays(x_m, y_m, np.asarray(z_m, dtype=np.float64))
    lat_deg, lon_deg = surface_to_geodetic(frame.origin, x, y)
    return lat_deg, lon_deg, _number(frame.origin_alt_m + z)


def geodetic_to_map(frame: GridFrame, lat_deg: F, lon_deg: F, alt_m: float | F) -> tuple[F, F, F]:
    """Return x, y, z in metres in the map frame: the inverse of `map_to_geodetic`.

    Args:
        frame: The grid.
        lat_deg: WGS84 latitude, a number or an array.
        lon_deg: WGS84 longitude.
        alt_m: Height above the ellipsoid.
    """
    x_m, y_m, _ = _surface_point(frame, lat_deg, lon_deg)
    z_m = np.asarray(alt_m, dtype=np.float64) - frame.origin_alt_m + np.zeros_like(x_m)
    return x_m, y_m, _number(z_m)


def search_to_geodetic(frame: GridFrame, east_m: F, south_m: F) -> tuple[F, F]:
    """Return latitude and longitude in degrees of places in the metres of the search.

    Args:
        frame: The grid.
        east_m: Metres to the east of its north-west corner, a number or an array.
        south_m: Metres to the south of it.
    """
    lat_deg, lon_deg, _ = map_to_geodetic(frame, east_m, flip_y(frame.extent.height, south_m), 0.0)
    return lat_deg, lon_deg


def geodetic_to_search(frame: GridFrame, lat_deg: F, lon_deg: F) -> tuple[F, F]:
    """Return metres to the east and to the south: the inverse of `search_to_geodetic`.

    Args:
        frame: The grid.
        lat_deg: WGS84 latitude, a number or an array.
        lon_deg: WGS84 longitude.
    """
    x_m, y_m, _ = _surface_point(frame, lat_deg, lon_deg)
    return x_m, flip_y(frame.extent.height, y_m)


def on_near_side(frame: GridFrame, lat_deg: float, lon_deg: float) -> bool:
    """Return whether a place is on the origin's side of the Earth, where x and y are unique.

    Args:
        frame: The grid.
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
    """
    return bool(_surface_point(frame, lat_deg, lon_deg)[2] > _NEAR_SIDE_M)


def map_in_earth(
    frame: GridFrame,
) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """Return where the map's origin is in ECEF, m, and how its axes are turned, x y z w.

    The axes are those of ENU at the origin: x and y are the map's everywhere, z is the tangent
    plane's, not the height above the sea below.
    """
    lat_deg, lon_deg, alt_m = frame.origin
    x_m, y_m, z_m = pymap3d.geodetic2ecef(lat_deg, lon_deg, alt_m)
    # About the Earth's axis to the east, then about the east from there to up.
    half_yaw, half_roll = math.radians(lon_deg + 90.0) / 2, math.radians(90.0 - lat_deg) / 2
    turn = (
        math.cos(half_yaw) * math.sin(half_roll),
        math.sin(half_yaw) * math.sin(half_roll),
        math.sin(half_yaw) * math.cos(half_roll),
        math.cos(half_yaw) * math.cos(half_roll),
    )
    return (float(x_m), float(y_m), float(z_m)), turn


def _surface_point(frame: GridFrame, lat_deg: Any, lon_deg: Any) -> tuple[Any, Any, Any]:
    """Return east, north and up of a place at the origin's height above the ellipsoid."""
    of_numbers = isinstance(lat_deg, float) and isinstance(lon_deg, float)
    convert = _surface_fix if of_numbers else _converted
    return convert(frame.origin, lat_deg, lon_deg)


def _converted(origin: Origin, lat_deg: Any, lon_deg: Any) -> tuple[Any, Any, Any]:
    return through_ecef(pymap3d.geodetic2enu, origin, lat_deg, lon_deg, origin[2])


_surface_fix = lru_cache(maxsize=1 << 10)(_converted)
"""The same, remembered: a fence is asked for the same homes and middles many times a second."""


def cell_to_geodetic(frame: GridFrame, col: F, row: F, z_m: float | F) -> tuple[F, F, F]:
    """Return latitude, longitude (degrees) and ellipsoidal height (m) over the centre of a cell.

    Args:
        frame: The grid.
        col: Column, a number or an array; a fraction lies between cells.
        row: Row.
        z_m: Metres above the surface: see `map_to_geodetic`.
    """
    x_m, y_m = cell_to_map(frame, col, row)
    return map_to_geodetic(frame, x_m, y_m, z_m)


@lru_cache(maxsize=1 << 16)
def cell_fix(frame: GridFrame, drone: int, col: int, row: int) -> tuple[float, float, float]:
    """Return `cell_to_geodetic` at a drone's altitude, remembered: drones revisit few cells."""
    return map_to_geodetic(frame, *cell_to_map(frame, col, row), frame.alt_of(drone))


def offset_m(start: tuple[float, float], end: tuple[float, float]) -> tuple[float, float]:
    """Return metres to north and east between places in degrees that are near each other.

    The Earth is a sphere here: they are exact to 0.6 % of the distance, enough to compare it with a
    tolerance.
    """
    north_m = (end[0] - start[0]) * _METRES_PER_DEGREE
    return north_m, _east_deg(start, end) * _METRES_PER_DEGREE * math.cos(math.radians(start[0]))


def between(
    start: tuple[float, float], end: tuple[float, float], share: float
) -> tuple[float, float]:
    """Return the place at a share of the way between places in degrees that are near each other.

    A share above 1 is behind the end.
    """
    lat_deg = start[0] + share * (end[0] - start[0])
    return lat_deg, (start[1] + share * _east_deg(start, end) + 180) % 360 - 180


def _east_deg(start: tuple[float, float], end: tuple[float, float]) -> float:
    """Return the difference of two longitudes, which may be on both sides of the antimeridian."""
    return (end[1] - start[1] + 180) % 360 - 180


def _number(array: Any) -> Any:
    """Return an array, or its number if it has no dimensions."""
    return array if array.ndim else float(array)

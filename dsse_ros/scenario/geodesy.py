# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Metres on the grid to WGS84: ENU at the grid's south-west corner through ECEF, by pymap3d.

x and y are exact in ENU; flat-Earth formulas are off by metres within a few kilometres.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pymap3d
from numpy.typing import NDArray

_SURFACE_M = 1e-6
"""Tolerance of the height above the surface."""
_MAX_TURNS = 20

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

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled motion of particles: the midpoint rule in metres on the WGS84 ellipsoid."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import inlined, kernel
from dsse_ros.world.drift.leeway import Leeway

WGS84_A_M = 6378137.0
WGS84_E2 = 6.69437999014131699e-3
_OF_EQUATOR = math.degrees(1.0 / WGS84_A_M)
_OF_MERIDIAN = _OF_EQUATOR / (1.0 - WGS84_E2)
"""Degrees in a metre at the equator, of longitude and of latitude."""

MOVED, NO_WIND, NO_CURRENT, NO_WAVES = 0, 1, 2, 3
"""Results of `move`."""


class Particles(NamedTuple):
    """The state of M particles.

    Attributes:
        lat_deg: (M,) float64, WGS84 latitude.
        lon_deg: (M,) float64, WGS84 longitude; it does not wrap while particles move.
        released_s: (M,) float64, time from which, or backwards until which, a particle drifts.
        afloat: (M,) bool, whether a particle drifts or is stranded.
        leeway: See `Leeway`.
        wind_error: (2, M) float64, error of the wind to the east and to the north, in m/s.
        current_error: (2, M) float64, the same of the current.
    """

    lat_deg: NDArray[np.float64]
    lon_deg: NDArray[np.float64]
    released_s: NDArray[np.float64]
    afloat: NDArray[np.bool_]
    leeway: Leeway
    wind_error: NDArray[np.float64]
    current_error: NDArray[np.float64]


def degrees_per_metre(lat_deg):
    """Return the degrees of latitude and of longitude in a metre on the ellipsoid.

    Args:
        lat_deg: A number or an array.
    """
    square = np.sin(np.radians(lat_deg)) ** 2
    w2 = 1.0 - WGS84_E2 * square
    w = np.sqrt(w2)
    return _OF_MERIDIAN * w2 * w, _OF_EQUATOR * w / np.sqrt(1.0 - square)


_degrees_per_metre = inlined(degrees_per_metre)


@inlined
def _below(axis, value):
    """Return index and weight of the value after `value` on an axis; -1 if it is off the axis."""
    last = len(axis) - 1
    if last == 0:
        return 0, 0.0
    if not axis[0] <= value <= axis[last]:
        return -1, 0.0
    low, high = 0, last
    while high - low > 1:
        middle = (low + high) // 2
        if axis[middle] <= value:
            low = middle
        else:
            high = middle
    return low, (value - axis[low]) / (axis[low + 1] - axis[low])


@inlined
def _at_time(flow, t, j, i, v, u):
    """Return the flow at one of its times, from the neighbours that have a value; or NaN.

    The shore cells of a current have values on the sea side only.
    """
    if v == 0.0 and u == 0.0:
        e, n = flow.east_mps[t, j, i], flow.north_mps[t, j, i]
        # One component alone is no velocity.
        return e + 0.0 * n, n + 0.0 * e
    east, north, total = 0.0, 0.0, 0.0
    for dj in range(2):
        weight_j = v if dj else 1.0 - v
        if weight_j == 0.0:
            continue
        for di in range(2):
            weight = weight_j * (u if di else 1.0 - u)
            if weight == 0.0:
                continue
            e, n = flow.east_mps[t, j + dj, i + di], flow.north_mps[t, j + dj, i + di]
            if math.isnan(e) or math.isnan(n):
                continue
            east += weight * e
            north += weight * n
            total += weight
    if total == 0.0:
        return math.nan, math.nan
    return east / total, north / total


@inlined
def _index(lookup, j, i, v, u, last):
    """Return index and weight of the next one that a lookup has at a place; -1 off the grid."""
    value = lookup[j, i]
    if v > 0.0 or u > 0.0:
        # A single row or column has no next one.
        nj, ni = min(j + 1, lookup.shape[0] - 1), min(i + 1, lookup.shape[1] - 1)
        south = (1.0 - u) * value + u * lookup[j, ni]
        north = (1.0 - u) * lookup[nj, i] + u * lookup[nj, ni]
        value = (1.0 - v) * south + v * north
    # Rounding must not lose the last point.
    if not -1e-9 <= value <= last + 1e-9:
        return -1, 0.0
    index = min(max(int(math.floor(value)), 0), max(last - 1, 0))
    return index, min(max(value - index, 0.0), 1.0)


@inlined
def flow_at(flow, lat_deg, lon_deg, time_s):
    """Return the velocity (east, north) of a flow in m/s, or NaN where it has none."""
    t, w = _below(flow.times_s, time_s)
    j, v = _below(flow.lats_deg, lat_deg)
    # Files have longitudes from -180 or from 0.
    i, u = _below(flow.lons_deg, lon_deg)
    if i < 0:
        i, u = _below(flow.lons_deg, lon_deg + 360.0)
    if i < 0:
        i, u = _below(flow.lons_deg, lon_deg - 360.0)
    if t < 0 or j < 0 or i < 0:
        return math.nan, math.nan
    if len(flow.rows) > 0:
        row, v_of_row = _index(flow.rows, j, i, v, u, flow.east_mps.shape[1] - 1)
        col, u_of_col = _index(flow.cols, j, i, v, u, flow.east_mps.shape[2] - 1)
        if row < 0 or col < 0:
            return math.nan, math.nan
        j, v, i, u = row, v_of_row, col, u_of_col
    east, north = _at_time(flow, t, j, i, v, u)
    if w > 0.0:
        later_east, later_north = _at_time(flow, t + 1, j, i, v, u)
        east += w * (later_east - east)
        north += w * (later_north - north)
    return east, north


@kernel
def read_flow(flow, lat_deg, lon_deg, time_s):
    """Return `flow_at` to Python."""
    return flow_at(flow, lat_deg, lon_deg, time_s)


@inlined
def _velocity(p, m, lat_deg, lon_deg, time_s, wind, current, waves):
    """Return the velocity (east, north) of a particle in m/s, and what is missing if it is NaN."""
    wind_east, wind_north = flow_at(wind, lat_deg, lon_deg, time_s)
    if math.isnan(wind_east):
        return math.nan, math.nan, NO_WIND
    east, north = flow_at(current, lat_deg, lon_deg, time_s)
    if math.isnan(east):
        return math.nan, math.nan, NO_CURRENT
    if waves is not None:
        stokes_east, stokes_north = flow_at(waves, lat_deg, lon_deg, time_s)
        if math.isnan(stokes_east):
            return math.nan, math.nan, NO_WAVES
        east += stokes_east
        north += stokes_north
    wind_east += p.wind_error[0, m]
    wind_north += p.wind_error[1, m]
    speed = math.sqrt(wind_east * wind_east + wind_north * wind_north)
    # A calm has no direction; the offsets then point as in a wind to the north.
    x, y = (wind_east / speed, wind_north / speed) if speed > 0.0 else (0.0, 1.0)
    leeway = p.leeway
    down = leeway.downwind_slope[m] * speed + leeway.downwind_mps[m]
    cross = leeway.crosswind_slope[m] * speed + leeway.crosswind_mps[m]
    east += p.current_error[0, m] + down * x + cross * y
    north += p.current_error[1, m] + down * y - cross * x
    return east, north, MOVED


@inlined
def is_land(shore, lat_deg, lon_deg):
    """Return whether a position is on land; beyond the raster everything is sea."""
    row = math.floor((lat_deg - shore.south_deg) / shore.lat_step_deg)
    col = math.floor((lon_deg - shore.west_deg) / shore.lon_step_deg)
    rows, cols = shore.land.shape
    return 0 <= row < rows and 0 <= col < cols and shore.land[row, col]


@kernel
def mark_land(shore, lats_deg, lons_deg, found):
    """Write to `found`, (M,) bool, whether positions (M,) are on land."""
    for m in range(len(found)):
        found[m] = is_land(shore, lats_deg[m], lons_deg[m])


@inlined
def _strand_or_go(p, m, lat_deg, lon_deg, shore):
    """Put a particle at its new position, or at the last one at sea before it reaches land."""
    from_lat, from_lon = p.lat_deg[m], p.lon_deg[m]
    # A step may cross a spit, so look at the way in parts no longer than a cell of the raster.
    parts = 1 + math.floor(
        max(
            abs(lat_deg - from_lat) / shore.lat_step_deg,
            abs(lon_deg - from_lon) / shore.lon_step_deg,
        )
    )
    for k in range(1, parts + 1):
        next_lat = from_lat + (lat_deg - from_lat) * k / parts
        next_lon = from_lon + (lon_deg - from_lon) * k / parts
        if is_land(shore, next_lat, next_lon):
            p.afloat[m] = False
            return
        p.lat_deg[m], p.lon_deg[m] = next_lat, next_lon


@inlined
def _jibe(leeway, m):
    """Exchange the crosswind coefficients of a particle with those of the other side."""
    slope, mps = leeway.crosswind_slope[m], leeway.crosswind_mps[m]
    leeway.crosswind_slope[m], leeway.crosswind_mps[m] = leeway.other_slope[m], leeway.other_mps[m]
    leeway.other_slope[m], leeway.other_mps[m] = slope, mps


@kernel
def move(p, time_s, step_s, flows, shore, jibing, jibing_per_hour):
    """Move the particles that are afloat by one step.

    Args:
        p: `Particles`.
        time_s: Time at the start of the step, in seconds since 1970-01-01 UTC.
        step_s: Duration, negative backwards in time.
        flows: `FlowArrays` of the wind, of the current, and of the Stokes drift or None.
        shore: `Shore`, or None.
        jibing: (M,) float64 from [0, 1), draws that decide who jibes; not read without jibing.
        jibing_per_hour: Probability that an object has jibed after an hour.

    Returns:
        `MOVED`, or what a particle lacks, and the number of this particle.
    """
    wind, current, waves = flows
    of_step = 1.0 - (1.0 - jibing_per_hour) ** (abs(step_s) / 3600.0)
    for m in range(len(p.lat_deg)):
        if not p.afloat[m]:
            continue
        # A particle that is released within the step moves for the rest of it.
        end_s = time_s + step_s
        dt = end_s - p.released_s[m]
        dt = min(max(dt, 0.0), step_s) if step_s > 0.0 else max(min(dt, 0.0), step_s)
        if dt == 0.0:
            continue
        lat, lon = p.lat_deg[m], p.lon_deg[m]
        east, north, lacks = _velocity(p, m, lat, lon, end_s - dt, wind, current, waves)
        if lacks != MOVED:
            return lacks, m
        lat_per_m, lon_per_m = _degrees_per_metre(lat)
        middle_lat = lat + north * 0.5 * dt * lat_per_m
        middle_lon = lon + east * 0.5 * dt * lon_per_m
        east, north, lacks = _velocity(
            p, m, middle_lat, middle_lon, end_s - 0.5 * dt, wind, current, waves
        )
        if lacks != MOVED:
            return lacks, m
        lat_per_m, lon_per_m = _degrees_per_metre(middle_lat)
        lat += north * dt * lat_per_m
        lon += east * dt * lon_per_m
        if shore is None:
            p.lat_deg[m], p.lon_deg[m] = lat, lon
        else:
            _strand_or_go(p, m, lat, lon, shore)
        if jibing_per_hour > 0.0:
            chance = of_step
            if dt != step_s:
                chance = 1.0 - (1.0 - jibing_per_hour) ** (abs(dt) / 3600.0)
            if jibing[m] < chance:
                _jibe(p.leeway, m)
    return MOVED, -1

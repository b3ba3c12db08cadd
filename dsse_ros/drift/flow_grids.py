# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A pair of variables on the grid of a `Flow`: the part that is needed, filled at the coast."""

from __future__ import annotations

import logging
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.drift.coordinates import Place, place_of, time_of
from dsse_ros.drift.flow import MAX_SPEED_MPS, Extent, Flow, utc
from dsse_ros.drift.netcdf import Unfit, times_of
from dsse_ros.drift.shore import Box
from dsse_ros.drift.velocity_pairs import Pair

MAX_VALUES = 20_000_000
"""Values of a variable that are read at most, 80 MB."""
SAME_MERIDIAN_DEG = 1e-4
"""Longitudes that differ by less are one: files of the globe have their first meridian twice."""
_MPS = ("m s-1", "m s^-1", "m/s", "m s**-1", "meter second-1", "meter/sec", "m.s-1", "mps")
_LOGGER = logging.getLogger(__name__)


class Span(NamedTuple):
    """Where and when a flow may be needed.

    Attributes:
        box: The area.
        begin_s: First time, in seconds since 1970-01-01 UTC.
        end_s: Last time.
    """

    box: Box
    begin_s: float
    end_s: float


class _Axis(NamedTuple):
    """The part of an axis that is read.

    Attributes:
        dim: Its dimension.
        indices: (N,) int64.
        values: (N,) float64, increasing values there.
    """

    dim: str
    indices: NDArray[np.int64]
    values: NDArray[np.float64]


def flow_on_grid(dataset: Any, pair: Pair, span: Span, gap_cells: int, source: str) -> Flow:
    """Return the flow of a pair in a span.

    Args:
        dataset: The file as an `xarray.Dataset`.
        pair: Its variables.
        span: Where the flow may be needed; little beyond it is read.
        gap_cells: Cells over which the nearest value fills a gap.
        source: See `Flow`.

    Raises:
        Unfit: If the file does not have it.
    """
    place, time = place_of(dataset, pair.east), time_of(dataset, pair.east)
    times_s, lats, lons = times_of(time), _values(place.lat), _values(place.lon)
    extent, box = Extent.of(times_s, lats, lons), span.box
    axes = (
        _part("time", time.dims[0], times_s, span.begin_s, span.end_s, 0),
        _part("latitude", place.lat.dims[0], lats, box.south_deg, box.north_deg, gap_cells),
        _longitudes(place, lons, box, gap_cells),
    )
    shape = tuple(len(axis.indices) for axis in axes)
    if math.prod(shape) > MAX_VALUES:
        raise Unfit(
            f"{pair.names} must have at most {MAX_VALUES} values in the area and the times needed, "
            f"got {' x '.join(map(str, shape))}"
        )
    east, north = (_read(variable, axes) for variable in (pair.east, pair.north))
    gaps = np.isnan(east + north)
    if gaps.all():
        raise Unfit(f"{pair.names} has no value in the area and the times needed")
    if gap_cells and gaps.any():
        filled = _fill(east, north, gaps, gap_cells)
        _LOGGER.warning(
            "%s: %d of %d cells without a value take the nearest one, at most %d cells away",
            source, filled, int(gaps.any(axis=0).sum()), gap_cells,
        )  # fmt: skip
    times, rows, cols = (axis.values for axis in axes)
    return Flow(times, rows, cols, east, north, source, extent, gap_cells)


def _values(coordinate: Any) -> NDArray[np.float64]:
    """Return the values of a coordinate.

    Raises:
        Unfit: If one is missing.
    """
    values = np.ma.filled(np.ma.asarray(coordinate.values, np.float64), np.nan)
    if not values.size or not np.isfinite(values).all():
        raise Unfit(f"{coordinate.name} must have values without gaps")
    return np.asarray(values)


def _part(
    what: str, dim: str, given: NDArray[np.float64], low: float, high: float, margin: int
) -> _Axis:
    """Return the part of an axis around [low, high] and a margin of some values.

    It may end earlier: a drift outside the file is refused later, with its place and time.

    Raises:
        Unfit: If the axis has nothing there, or a value twice.
    """
    order = np.argsort(given, kind="stable")
    values = given[order]
    if (np.diff(values) <= 0).any():
        raise Unfit(f"{dim} must have each value once")
    if len(values) < 2 or high < values[0] or low > values[-1]:
        shown = utc if what == "time" else "{:.4f}".format
        raise Unfit(
            f"file must cover {what} within {shown(low)} to {shown(high)}, got {shown(values[0])} "
            f"to {shown(values[-1])}"
        )
    first = max(int(np.searchsorted(values, low, "right")) - 1 - margin, 0)
    last = min(int(np.searchsorted(values, high, "left")) + 1 + margin, len(values))
    # Interpolation needs two values.
    first = min(first, last - 2)
    return _Axis(dim, order[first:last], values[first:last])


def _longitudes(place: Place, given: NDArray[np.float64], box: Box, margin: int) -> _Axis:
    """Return the part of the longitudes, which may be from -180 or from 0."""
    centre = (box.west_deg + box.east_deg) / 2
    # Bring each longitude to the half turn on either side of the area.
    turned = (given - centre + 180.0) % 360.0 - 180.0 + centre
    order = np.argsort(turned, kind="stable")
    once = order[np.diff(turned[order], prepend=-np.inf) > SAME_MERIDIAN_DEG]
    dim = place.lon.dims[0]
    part = _part("longitude", dim, turned[once], box.west_deg, box.east_deg, margin)
    return part._replace(indices=once[part.indices])


def _read(variable: Any, axes: tuple[_Axis, ...]) -> NDArray[np.float32]:
    """Return a variable along these axes in m/s, NaN where there is no value.

    Raises:
        Unfit: If its units are no speed.
    """
    units = " ".join(str(variable.attrs.get("units", "")).split()).lower()
    if units not in _MPS:
        raise Unfit(f"{variable.name} must be in m/s, got units {units!r}")
    chosen = {axis.dim: _as_slice(axis.indices) for axis in axes}
    part = variable.isel(chosen).transpose(*(axis.dim for axis in axes))
    found = np.ma.filled(np.ma.asarray(part.values, np.float32), np.nan)
    # Restore the increasing order of axes that were read backward.
    for number, axis in enumerate(axes):
        if isinstance(chosen[axis.dim], slice) and axis.indices[0] > axis.indices[-1]:
            found = np.flip(found, number)
    # Fill values that the file does not declare are beyond any speed.
    found = np.where(np.abs(found) <= MAX_SPEED_MPS, found, np.nan)
    return np.ascontiguousarray(found, np.float32)


def _as_slice(index: NDArray[np.int64]) -> Any:
    """Return indices as a slice where possible, which reads a part of the file only."""
    low, high = int(index.min()), int(index.max())
    # Longitudes across the file's own seam, and times out of order, are not a slice.
    in_order = (np.abs(np.diff(index)) == 1).all() and high - low + 1 == len(index)
    return slice(low, high + 1) if in_order else index


def _fill(
    east: NDArray[np.float32], north: NDArray[np.float32], gaps: NDArray[np.bool_], cells: int
) -> int:
    """Fill gaps near values, time by time, in place; return the number of cells filled.

    Args:
        east: (T, Y, X).
        north: (T, Y, X).
        gaps: (T, Y, X), where one of them has no value.
        cells: Greatest distance of the value.
    """
    from scipy.ndimage import distance_transform_edt

    filled = np.zeros(gaps.shape[1:], np.bool_)
    before, near, rows, cols = None, filled, filled, filled
    for number, gap in enumerate(gaps):
        if gap.all() or not gap.any():
            continue
        if before is None or not np.array_equal(gap, before):
            distance, (rows, cols) = distance_transform_edt(gap, return_indices=True)
            near, before = gap & (distance <= cells), gap
        for values in (east[number], north[number]):
            values[near] = values[rows[near], cols[near]]
        filled |= near
    return int(filled.sum())

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Wind and current from NetCDF files on a regular grid of latitude and longitude (CF conventions).

Variables are found by their CF standard names, or by common names. Only the area and the times that
are needed are read.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.drift.flow import MAX_SPEED_MPS, Flow, Kind, utc
from dsse_ros.drift.netcdf import check_installed, in_seconds, opened
from dsse_ros.drift.shore import Box

MAX_VALUES = 20_000_000
"""Values of a variable that are read at most, 80 MB."""

Names = tuple[tuple[str, ...], tuple[str, ...]]
_VELOCITIES: dict[Kind, tuple[Names, Names]] = {
    "wind": (
        (("eastward_wind", "x_wind"), ("u10", "u10m", "x_wind_10m", "10u")),
        (("northward_wind", "y_wind"), ("v10", "v10m", "y_wind_10m", "10v")),
    ),
    "current": (
        (
            ("eastward_sea_water_velocity", "surface_eastward_sea_water_velocity",
             "x_sea_water_velocity"),
            ("uo", "water_u", "u"),
        ),
        (
            ("northward_sea_water_velocity", "surface_northward_sea_water_velocity",
             "y_sea_water_velocity"),
            ("vo", "water_v", "v"),
        ),
    ),
}  # fmt: skip
"""Standard names and common names of the components to the east and to the north."""
_AXES: dict[str, Names] = {
    "lat": (("latitude",), ("lat", "latitude")),
    "lon": (("longitude",), ("lon", "longitude")),
    "time": (("time",), ("time",)),
}
_DEPTHS = ("depth", "height", "altitude", "ocean_sigma_coordinate", "ocean_s_coordinate")
_MPS = ("m s-1", "m s^-1", "m/s", "m s**-1", "meter second-1", "meter/sec", "m.s-1", "mps")


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


def read_netcdf(kind: Kind, path: str | os.PathLike[str], span: Span) -> Flow:
    """Return the flow of a file where and when it may be needed.

    Of several depths or heights the one nearest to the surface counts. Without a time dimension the
    flow is constant.

    Args:
        kind: What to read.
        path: A NetCDF file.
        span: Where the flow may be needed; values beyond it are not read.

    Raises:
        ValueError: If the file cannot be read or has nothing in the span; one line.
    """
    name = os.fspath(path)
    check_installed(f"{kind} {name!r}")
    try:
        with opened(path) as dataset:
            return _File(kind, name, dataset).flow(span)
    except _Refusal as refusal:
        raise ValueError(str(refusal)) from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise ValueError(f"{kind} {name!r} must be a NetCDF file: {reason}") from None
    except (KeyError, RuntimeError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ValueError(f"{kind} {name!r} must be a CF-NetCDF file: {reason}") from None


class _Refusal(Exception):
    """Why a file is refused, in one line."""


class _Axis(NamedTuple):
    """A coordinate of one dimension."""

    name: str
    values: NDArray[np.float64]
    units: str
    attributes: dict[str, Any]


class _File:
    """An open file.

    Args:
        kind: What to read.
        name: Its path, for messages.
        dataset: Its `xarray.Dataset`, with times as numbers.
    """

    def __init__(self, kind: Kind, name: str, dataset: Any) -> None:
        self._what = f"{kind} {name!r}"
        self._dataset = dataset
        self._variables = [self._find(names, "a variable") for names in _VELOCITIES[kind]]

    def flow(self, span: Span) -> Flow:
        """Return the flow in this span.

        Raises:
            _Refusal: If the file does not have it.
        """
        time, lat, lon = self._axis("time"), self._required("lat"), self._required("lon")
        box = span.box
        rows, lats = self._within("latitude", lat, box.south_deg, box.north_deg)
        cols, lons = self._longitudes(lon, box)
        when, times_s = np.zeros(1, np.int64), np.zeros(1)
        if time is not None:
            axis = time._replace(values=self._seconds(time))
            when, times_s = self._within("time", axis, span.begin_s, span.end_s)
        shape = len(times_s), len(lats), len(lons)
        if math.prod(shape) > MAX_VALUES:
            raise _Refusal(
                f"{self._what} must have at most {MAX_VALUES} values in the area and the times "
                f"needed, got {' x '.join(map(str, shape))}"
            )
        values = [
            self._values(variable, (time, lat, lon), (when, rows, cols)).reshape(shape)
            for variable in self._variables
        ]
        if np.isnan(values[0] + values[1]).all():
            raise _Refusal(f"{self._what} has no value in the area and the times needed")
        names = " and ".join(str(variable.name) for variable in self._variables)
        # The name ends in the variables, so that every message about gaps has them.
        source = f"{self._what.split(' ', 1)[1][1:-1]}: {names}"
        return Flow(times_s, lats, lons, values[0], values[1], source)

    def _find(self, names: Names, what: str) -> Any:
        """Return the variable with one of these standard names, or one of these names."""
        standard, common = names
        variables = self._dataset.variables
        for wanted in standard:
            for name, variable in variables.items():
                if variable.attrs.get("standard_name") == wanted:
                    return self._dataset[name]
        for wanted in common:
            if wanted in variables:
                return self._dataset[wanted]
        raise _Refusal(
            f"{self._what} must have {what} {' or '.join((*standard, *common))}, got "
            f"{', '.join(map(str, variables)) or 'none'}"
        )

    def _axis(self, name: str) -> _Axis | None:
        """Return the coordinate of the first component along an axis; None if it has none."""
        dims = self._variables[0].dims
        standard, common = _AXES[name]
        for dim in dims:
            axis = self._dataset.variables.get(dim)
            if axis is not None and (
                axis.attrs.get("standard_name") in standard or str(dim).lower() in common
            ):
                values = np.ma.filled(np.ma.asarray(axis.values, np.float64), np.nan)
                if len(values) and np.isfinite(values).all():
                    return _Axis(str(dim), values, str(axis.attrs.get("units", "")), axis.attrs)
                raise _Refusal(f"{self._what}: {dim} must have values without gaps")
        return None

    def _required(self, name: str) -> _Axis:
        """Return a coordinate that is not optional."""
        axis = self._axis(name)
        if axis is None:
            variable = self._variables[0]
            raise _Refusal(
                f"{self._what}: {variable.name} must be on a regular grid of latitude and "
                f"longitude, got the dimensions {', '.join(map(str, variable.dims))}"
            )
        return axis

    def _seconds(self, time: _Axis) -> NDArray[np.float64]:
        """Return times in seconds since 1970-01-01 UTC."""
        try:
            calendar = str(time.attributes.get("calendar", "standard"))
            return in_seconds(time.values, time.units, calendar)
        except ValueError as error:
            raise _Refusal(f"{self._what}: {time.name} must have {error}") from None

    def _within(
        self, what: str, axis: _Axis, low: float, high: float
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return indices and values, increasing, of the part of an axis around [low, high].

        It may end earlier: a request outside the file is refused, with its place and time.
        """
        order = np.argsort(axis.values, kind="stable")
        values = axis.values[order]
        if (np.diff(values) <= 0).any():
            raise _Refusal(f"{self._what}: {axis.name} must have each value once")
        if len(values) < 2 or high < values[0] or low > values[-1]:
            shown = utc if what == "time" else "{:.4f}".format
            raise _Refusal(
                f"{self._what} must cover {what} within {shown(low)} to {shown(high)}, got "
                f"{shown(values[0])} to {shown(values[-1])}"
            )
        first = max(int(np.searchsorted(values, low, "right")) - 1, 0)
        last = min(int(np.searchsorted(values, high, "left")) + 1, len(values))
        # Interpolation needs two values.
        first = min(first, last - 2)
        return order[first:last], values[first:last]

    def _longitudes(self, axis: _Axis, box: Box) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return `_within` for longitudes, which may be from -180 or from 0."""
        centre = (box.west_deg + box.east_deg) / 2
        # Bring each longitude to the half turn on either side of the area.
        turned = (axis.values - centre + 180.0) % 360.0 - 180.0 + centre
        return self._within("longitude", axis._replace(values=turned), box.west_deg, box.east_deg)

    def _values(
        self, variable: Any, axes: Sequence[_Axis | None], indices: Sequence[NDArray[np.int64]]
    ) -> NDArray[np.float32]:
        """Return the values of a variable, (T, Y, X) float32, NaN where there are none."""
        units = " ".join(str(variable.attrs.get("units", "")).split()).lower()
        if units not in _MPS:
            raise _Refusal(f"{self._what}: {variable.name} must be in m/s, got units {units!r}")
        chosen = {
            axis.name: index for axis, index in zip(axes, indices, strict=True) if axis is not None
        }
        for dim in variable.dims:
            if dim not in chosen:
                chosen[dim] = self._surface(variable, str(dim))
        if set(chosen) != set(variable.dims):
            raise _Refusal(
                f"{self._what}: {variable.name} must have the dimensions "
                f"{', '.join(map(str, self._variables[0].dims))}, got "
                f"{', '.join(map(str, variable.dims))}"
            )
        order = [axis.name for axis in axes if axis is not None]
        read = {dim: _as_slice(index) for dim, index in chosen.items()}
        part = variable.isel(read)
        found = part.transpose(*order, *(d for d in part.dims if d not in order)).values
        found = np.ma.filled(np.ma.asarray(found, np.float32), np.nan)
        # Restore the increasing order of axes that were read backward.
        for position, name in enumerate(order):
            if isinstance(read[name], slice) and chosen[name][0] > chosen[name][-1]:
                found = np.flip(found, position)
        # Fill values that the file does not declare are beyond any speed.
        found = np.where(np.abs(found) <= MAX_SPEED_MPS, found, np.nan)
        return np.ascontiguousarray(found, np.float32)

    def _surface(self, variable: Any, dim: str) -> NDArray[np.int64]:
        """Return the index of the level nearest to the surface, or of the only one."""
        axis = self._dataset.variables.get(dim)
        if variable.sizes[dim] == 1:
            return np.zeros(1, np.int64)
        if axis is not None and (
            axis.attrs.get("standard_name") in _DEPTHS
            or dim.lower() in ("depth", "lev", "level", "z", "height", "deptht", "depthu")
            or "positive" in axis.attrs
        ):
            return np.array([int(np.nanargmin(np.abs(np.asarray(axis.values, np.float64))))])
        raise _Refusal(
            f"{self._what}: {variable.name} must depend on time, depth, latitude and longitude, "
            f"got {dim}"
        )


def _as_slice(index: NDArray[np.int64]) -> Any:
    """Return indices as a slice where possible, which reads a part of the file only."""
    if len(index) == 1:
        return slice(int(index[0]), int(index[0]) + 1)
    low, high = int(index.min()), int(index.max())
    # Longitudes across the file's own seam are not a slice.
    return slice(low, high + 1) if high - low + 1 == len(index) else index

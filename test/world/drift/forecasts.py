# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Small made-up files of the structure that services publish, and their values by xarray alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.world.drift.flow import Flow, Span, seconds
from dsse_ros.world.drift.kernels import read_flow
from dsse_ros.world.drift.shore import Box

xarray = pytest.importorskip("xarray")
pytest.importorskip("netCDF4")

START = "2026-01-17 12:00"
START_S = seconds("2026-01-17T12:00Z")
HOURS = np.arange(7.0)
LATS = np.linspace(-25.0, -23.0, 17)
LONS = np.linspace(-47.0, -45.0, 17)
SPAN = Span(Box(-24.25, -23.75, -46.25, -45.75), START_S + 1800, START_S + 5 * 3600)
PLACES = ((-24.1, -46.2, 1800.0), (-23.8, -45.8, 9000.0), (-24.25, -46.01, 17900.0))
"""Latitude, longitude and seconds after the start."""

STANDARD_NAMES = {
    "wind": ("eastward_wind", "northward_wind"),
    "current": ("eastward_sea_water_velocity", "northward_sea_water_velocity"),
}


def axis(dim: str, values: Any, **attributes: Any) -> Any:
    return xarray.DataArray(np.asarray(values), dims=(dim,), attrs=attributes)


def lattice(lats: Any = LATS, lons: Any = LONS, hours: Any = HOURS) -> dict[str, Any]:
    """Coordinates of a regular grid."""
    return {
        "time": axis("time", hours, standard_name="time", units=f"hours since {START}"),
        "lat": axis("lat", lats, standard_name="latitude", units="degrees_north"),
        "lon": axis("lon", lons, standard_name="longitude", units="degrees_east"),
    }


def velocity(coordinates: Mapping[str, Any], scale: float = 1.0) -> tuple[Any, Any]:
    """A smooth velocity to the east and to the north, which changes along all axes."""
    time, lat, lon = (coordinates[name] for name in ("time", "lat", "lon"))
    place = np.radians(lat) * 9 + np.radians(lon) * 5
    return scale * (np.sin(place) + 0.05 * time), scale * (np.cos(place) - 0.03 * time)


def pair(kind: str, names: Sequence[str], coordinates: Mapping[str, Any] | None = None, *,
         scale: float = 1.0, standard: bool = True, units: str | None = "m s-1",
         **attributes: Any) -> Any:  # fmt: skip
    """Return a data set with a pair of variables."""
    coordinates = lattice() if coordinates is None else coordinates
    sides = []
    for values, name in zip(velocity(coordinates, scale), STANDARD_NAMES[kind], strict=True):
        about = {"units": units} if units is not None else {}
        about |= {"standard_name": name} if standard else {}
        values = values.astype(np.float32)
        values.attrs = about | attributes
        sides.append(values)
    return xarray.Dataset(dict(zip(names, sides, strict=True)), coords=coordinates)


def levels(dataset: Any, name: str, values: Sequence[float], scales: Sequence[float],
           **attributes: Any) -> Any:  # fmt: skip
    """Return a data set with a vertical axis, on which each level has its share of the speed."""
    level = axis(name, values, **attributes)
    share = xarray.DataArray(np.asarray(scales, np.float32), dims=(name,))
    variables = {
        key: (variable * share).transpose("time", name, ...).assign_attrs(variable.attrs)
        for key, variable in dataset.data_vars.items()
    }
    return xarray.Dataset(variables, coords={**dataset.coords, name: level})


def written(dataset: Any, folder: Path, name: str = "forecast.nc") -> Path:
    path = folder / name
    dataset.to_netcdf(path, engine="netcdf4")
    return path


def by_xarray(path: Path, names: Sequence[str], place: tuple[float, float, float],
              **where: Any) -> tuple[float, float]:  # fmt: skip
    """Return a velocity by xarray's own linear interpolation."""
    lat, lon, after_s = place
    when = np.datetime64(round((START_S + after_s) * 1000), "ms").astype("datetime64[ns]")
    names_of = {"time": when, "lat": lat, "lon": lon}
    with xarray.open_dataset(path, engine="netcdf4") as dataset:
        for name, long_name in (("time", "valid_time"), ("lat", "latitude"), ("lon", "longitude")):
            if long_name in dataset.dims:
                names_of[long_name] = names_of.pop(name)
        found = [float(dataset[name].sel(where).interp(names_of)) for name in names]
    return found[0], found[1]


def by_flow(flow: Flow, place: tuple[float, float, float]) -> tuple[float, float]:
    lat, lon, after_s = place
    return read_flow(flow.arrays, lat, lon, START_S + after_s)

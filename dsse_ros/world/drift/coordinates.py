# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the coordinates of a variable mean, by the CF conventions: time, place and level.

A standard name decides; without one the units, then the name. See
https://cfconventions.org/cf-conventions/cf-conventions.html#coordinate-types.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.world.drift.netcdf import Unfit

Role = Literal["time", "lat", "lon", "y", "x", "height", "depth", "sigma", "seabed", "level", ""]
"""Meaning of a coordinate: `height` above the ground or the sea, `depth` below the surface, ocean
`sigma` (0 at the surface), height above the `seabed`; any other vertical `level`."""
_MAPPING, _ROTATED = "grid_mapping_name", "rotated_latitude_longitude"
VERTICAL = ("height", "depth", "sigma", "seabed", "level")

_BY_STANDARD_NAME: dict[str, Role] = {
    "time": "time",
    "latitude": "lat", "latitude_at_u_location": "lat", "latitude_at_v_location": "lat",
    "longitude": "lon", "longitude_at_u_location": "lon", "longitude_at_v_location": "lon",
    "projection_y_coordinate": "y", "grid_latitude": "y",
    "projection_x_coordinate": "x", "grid_longitude": "x",
    "height": "height", "height_above_mean_sea_level": "height", "altitude": "height",
    # Over the sea, where the ground is at 0 m.
    "atmosphere_hybrid_height_coordinate": "height",
    "depth": "depth", "height_above_sea_floor": "seabed", "air_pressure": "level",
}  # fmt: skip
PRESSURES = ("pa", "hpa", "kpa", "mb", "mbar", "millibar", "millibars")
_BY_UNITS: dict[str, Role] = {
    **dict.fromkeys(("degrees_north", "degree_north", "degree_n", "degrees_n"), "lat"),
    **dict.fromkeys(("degrees_east", "degree_east", "degree_e", "degrees_e"), "lon"),
    **dict.fromkeys(PRESSURES, "level"),
}
_METRES = {"m": 1.0, "meter": 1.0, "meters": 1.0, "metre": 1.0, "metres": 1.0, "km": 1000.0}
_BY_NAME: tuple[tuple[str, Role], ...] = (
    (r"latitude|xlat|(nav_lat|lat|tlat|ulat)_?(rho|u|v|c|t)?", "lat"),
    (r"longitude|xlong|(nav_lon|lon|tlon|ulon)_?(rho|u|v|c|t)?", "lon"),
    (r"times?|valid_time|ocean_time|time_counter|mt", "time"),
    (r".*height_?above_?(ground|sea|mean_sea_level).*|height\d*", "height"),
    (r"depth.*", "depth"),
    (r"s_rho|siglay|sigma", "sigma"),
    (r"lev|level|levels|z|.*(isobaric|pressure|hybrid|sigma|model_?level).*", "level"),
)
"""Meaning by the name alone, where neither standard name nor units have one."""


def role(variable: Any) -> Role:
    """Return what an `xarray` variable means as a coordinate."""
    name = str(variable.attrs.get("standard_name", "")).lower()
    if name in _BY_STANDARD_NAME:
        return _BY_STANDARD_NAME[name]
    if name.startswith(("ocean_s", "ocean_double_sigma")):
        return "sigma"
    if name.startswith("atmosphere_"):
        return "level"
    units = " ".join(str(variable.attrs.get("units", "")).lower().split())
    of_units = _BY_UNITS.get(units, "")
    if name and name != "unknown":
        # ROMS has latitudes with names of its own.
        return of_units if of_units in ("lat", "lon") else ""
    if of_units:
        return of_units
    if " since " in units:
        return "time"
    by_name = _by_name(str(variable.name))
    positive = str(variable.attrs.get("positive", "")).lower()
    if units in _METRES and by_name not in ("height", "depth") and positive in ("up", "down"):
        return "depth" if positive == "down" else "height"
    return by_name


def _by_name(name: str) -> Role:
    for pattern, meaning in _BY_NAME:
        if re.fullmatch(pattern, name.lower()):
            return meaning
    return ""


def coordinates(dataset: Any, variable: Any) -> Iterator[Any]:
    """Yield the variables of a data set that may be coordinates of a variable, the nearest first.

    These are those of its dimensions, those that it names, and those along its dimensions.
    """
    named = [dim for dim in variable.dims if dim in dataset.variables]
    named += [name for name in variable.coords if name not in named]
    others = [
        name
        for name, other in dataset.variables.items()
        if name not in named and other.dims and set(other.dims) <= set(variable.dims)
    ]
    for name in (*named, *others):
        if name != variable.name:
            # Those of the variable itself are at what was selected of it.
            yield variable.coords[name] if name in variable.coords else dataset[name]


def time_of(dataset: Any, variable: Any) -> Any:
    """Return the coordinate of time of a variable, along one of its dimensions or a single time.

    Raises:
        Unfit: If it has none.
    """
    found = [
        coordinate for coordinate in coordinates(dataset, variable) if role(coordinate) == "time"
    ]
    # A forecast has the time at which it was made, too; `valid_time` is the one that it is for.
    found = [coordinate for coordinate in found if coordinate.name == "valid_time"] or found
    if not found:
        raise Unfit(f"{variable.name} must have times, got the {_dimensions(variable)}")
    first = min(found, key=lambda coordinate: (coordinate.ndim > 1, -coordinate.ndim))
    if first.ndim > 1:
        dims = " and ".join(map(str, first.dims))
        raise Unfit(
            f"{variable.name} must have times along one dimension, got {dims}; choose from one of "
            "them by select"
        )
    return first


def _dimensions(variable: Any) -> str:
    return f"dimensions {', '.join(map(str, variable.dims)) or 'none'}"


class Place(NamedTuple):
    """The horizontal coordinates of a variable.

    Attributes:
        lat: Its latitudes, along one dimension or both; None if only a projection gives them. On a
            mesh, there is only one dimension.
        lon: Its longitudes.
        y: Coordinate of the rows in the plane of a projection; None without one.
        x: Coordinate of the columns.
        mapping: Attributes of the projection.
    """

    lat: Any = None
    lon: Any = None
    y: Any = None
    x: Any = None
    mapping: Mapping[str, Any] = {}

    @property
    def is_regular(self) -> bool:
        """Whether it is a grid of latitude and longitude."""
        return self.lat is not None and len(self.dims) == 2 and self.lat.ndim == 1

    @property
    def dims(self) -> tuple[str, ...]:
        """The dimensions, rows first."""
        rows, cols = (self.lat, self.lon) if self.y is None else (self.y, self.x)
        return tuple(dict.fromkeys((*rows.dims, *cols.dims)))


def place_of(dataset: Any, variable: Any) -> Place:
    """Return the horizontal coordinates of a variable.

    Raises:
        Unfit: If it has none.
    """
    found: dict[str, list[Any]] = {"lat": [], "lon": [], "y": [], "x": []}
    for coordinate in coordinates(dataset, variable):
        if (meaning := role(coordinate)) in found and coordinate.ndim:
            found[meaning].append(_steady(coordinate))
    mapping = _mapping(dataset, variable)
    if mapping.get(_MAPPING) == _ROTATED and any(
        axis.ndim == 1 for axis in found["lat"] + found["lon"]
    ):
        # These are axes of the rotated grid with the names of others.
        axes = [axis for axis in found["lat"] + found["lon"] if axis.ndim == 1]
        names = ", ".join(str(axis.name) for axis in axes)
        raise Unfit(f"{variable.name} must have grid_latitude and grid_longitude, got {names}")
    by_dims = {coordinate.dims: coordinate for coordinate in reversed(found["lon"])}
    for lat in found["lat"]:
        if lat.ndim == 1:
            for lon in found["lon"]:
                if lon.ndim == 1 and lon.dims != lat.dims:
                    return Place(lat, lon)
    flat = [(lat, by_dims[lat.dims]) for lat in found["lat"] if lat.dims in by_dims]
    lat, lon = next(((*pair,) for pair in flat if pair[0].ndim == 2), (None, None))
    if mapping and found["y"] and found["x"]:
        return Place(lat, lon, found["y"][0], found["x"][0], mapping)
    if lat is not None:
        return Place(lat, lon)
    if flat:
        return Place(*flat[0])
    raise Unfit(
        f"{variable.name} must have latitudes and longitudes, or the coordinates of a projection, "
        f"got the {_dimensions(variable)}"
    )


def _steady(coordinate: Any) -> Any:
    """Return places that a file, such as WRF's, has for each time, without time."""
    if coordinate.ndim < 3:
        return coordinate
    dim = coordinate.dims[0]
    first = coordinate.isel({dim: 0})
    if not np.array_equal(first.values, coordinate.isel({dim: -1}).values, equal_nan=True):
        raise Unfit(f"{coordinate.name} must be the same at all times")
    return first


def _mapping(dataset: Any, variable: Any) -> Mapping[str, Any]:
    """Return the attributes of the projection of a variable, empty if it has none."""
    name = variable.attrs.get("grid_mapping", variable.encoding.get("grid_mapping", ""))
    if name in dataset.variables:
        return dict(dataset[name].attrs)
    # A rotated pole counts even where the variable does not name it.
    every = [other.attrs for other in dataset.variables.values() if _MAPPING in other.attrs]
    return dict(every[0]) if len(every) == 1 and every[0][_MAPPING] == _ROTATED else {}


def metres(variable: Any) -> NDArray[np.float64]:
    """Return the values of a vertical coordinate, in metres where its units are lengths."""
    units = str(variable.attrs.get("units", "")).lower()
    return np.atleast_1d(np.asarray(variable.values, np.float64)) * _METRES.get(units, 1.0)


def is_level(variable: Any) -> bool:
    """Return whether a coordinate is vertical."""
    return role(variable) in VERTICAL

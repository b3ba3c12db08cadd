# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Made-up forecasts on grids that are not of latitude and longitude, with pyproj."""

from __future__ import annotations

import ast
import math
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from forecasts import HOURS, START, START_S, axis, xarray

pyproj = pytest.importorskip("pyproj")

LAMBERT = {
    "grid_mapping_name": "lambert_conformal_conic", "standard_parallel": [63.0, 63.0],
    "longitude_of_central_meridian": 15.0, "latitude_of_projection_origin": 63.0,
    "earth_radius": 6371000.0,
}  # fmt: skip
POLAR = {
    "grid_mapping_name": "polar_stereographic", "straight_vertical_longitude_from_pole": 70.0,
    "latitude_of_projection_origin": 90.0, "standard_parallel": 60.0, "earth_radius": 6371000.0,
}  # fmt: skip
ROTATED = {
    "grid_mapping_name": "rotated_latitude_longitude", "grid_north_pole_latitude": 39.25,
    "grid_north_pole_longitude": -162.0, "earth_radius": 6371000.0,
}  # fmt: skip

BERGEN = (60.2, 4.5)


def truth(lat: Any, lon: Any, hours: Any) -> tuple[Any, Any]:
    """A smooth velocity to the east and to the north in m/s."""
    place = np.radians(lat) * 40 + np.radians(lon) * 20
    return 0.3 * np.sin(place) + 0.02 * hours, 0.3 * np.cos(place) - 0.01 * hours


@lru_cache
def _transformer(mapping: str) -> Any:
    """Return the transformer of attributes as text; it takes a third of a second to make."""
    crs = pyproj.CRS.from_cf(ast.literal_eval(mapping))
    return pyproj.Transformer.from_crs(crs.source_crs, crs, always_xy=True)


class Plane(NamedTuple):
    """The plane of a projection."""

    mapping: dict[str, Any]

    def forward(self, lat: Any, lon: Any) -> tuple[Any, Any]:
        """X and y."""
        return _transformer(str(self.mapping)).transform(lon, lat)

    def inverse(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Latitude and longitude."""
        lon, lat = _transformer(str(self.mapping)).transform(x, y, direction="INVERSE")
        return lat, lon

    def angle(self, lat: Any, lon: Any, turned: float = 0.0) -> Any:
        """Angle from east to an axis that is turned against that of x, by pyproj's azimuths."""
        x, y = self.forward(lat, lon)
        step = 1e-3 if self.mapping["grid_mapping_name"].startswith("rotated") else 100.0
        lat2, lon2 = self.inverse(x + step * math.cos(turned), y + step * math.sin(turned))
        azimuth, _, _ = pyproj.Geod(a=6371000.0, b=6371000.0).inv(lon, lat, lon2, lat2)
        return np.radians(90.0 - np.asarray(azimuth))


def along(east: Any, north: Any, angle: Any) -> tuple[Any, Any]:
    """Components of a velocity along axes at an angle from east."""
    return (
        east * np.cos(angle) + north * np.sin(angle),
        north * np.cos(angle) - east * np.sin(angle),
    )


def projected(
    mapping: dict[str, Any], *, spacing: float, count: int = 60, names: tuple[str, str],
    standard: tuple[str, str], km: bool = False, down: bool = False, grid_relative: bool = True,
    with_places: bool = True, factor: float = 1.0, units: str = "m s-1",
) -> Any:  # fmt: skip
    """Return a forecast on the plane of a projection, around `BERGEN`."""
    plane = Plane(mapping)
    x0, y0 = plane.forward(*BERGEN)
    steps = spacing * (np.arange(count) - count / 2)
    x, y = x0 + steps, (y0 + steps)[:: -1 if down else 1]
    lat, lon = plane.inverse(*np.meshgrid(x, y))
    east, north = truth(lat, lon, HOURS[:, None, None])
    values = along(east, north, plane.angle(lat, lon)) if grid_relative else (east, north)
    rotated = mapping["grid_mapping_name"].startswith("rotated")
    words = ("grid_latitude", "grid_longitude") if rotated else (
        "projection_y_coordinate", "projection_x_coordinate",
    )  # fmt: skip
    about = {"units": "degrees" if rotated else "km" if km else "m"}
    scale = 1e-3 if km else 1.0
    coordinates = {
        "time": axis("time", HOURS, standard_name="time", units=f"hours since {START}"),
        "y": axis("y", y * scale, standard_name=words[0], **about),
        "x": axis("x", x * scale, standard_name=words[1], **about),
        "plane": xarray.DataArray(0, attrs=mapping),
    }
    if with_places:
        for name, place in (("latitude", lat), ("longitude", lon)):
            coordinates[name] = (("y", "x"), place, {"standard_name": name})
    variables = {
        name: (
            ("time", "y", "x"), (value / factor).astype(np.float32),
            {"standard_name": word, "units": units, "grid_mapping": "plane"},
        )
        for name, word, value in zip(names, standard, values, strict=True)
    }  # fmt: skip
    return xarray.Dataset(variables, coords=coordinates)


def by_pyproj(
    path: Path, plane: Plane, names: tuple[str, str], place: tuple[float, float, float],
    scale: float = 1.0,
) -> tuple[float, float]:  # fmt: skip
    """Return a velocity to the east and north: interpolated by xarray in the plane, then turned."""
    lat, lon, after_s = place
    x, y = plane.forward(lat, lon)
    when = np.datetime64(round((START_S + after_s) * 1000), "ms").astype("datetime64[ns]")
    with xarray.open_dataset(path) as dataset:
        u, v = (float(dataset[name].interp(time=when, x=x * scale, y=y * scale)) for name in names)
    angle = -plane.angle(lat, lon)
    return along(u, v, angle)


def staggered(
    layout: str, *, turned_deg: float = 35.0, spacing: float = 800.0,
    shape: tuple[int, int] = (50, 40),
) -> dict[str, Any]:  # fmt: skip
    """Return latitudes, longitudes and components of an Arakawa C grid that is turned.

    Args:
        layout: `roms` with one column of u and one row of v less; `nemo` with as many.
        turned_deg: Angle of its rows in a plane.
        spacing: Side of a cell in metres.
        shape: Rows and columns of the centres.
    """
    plane, turn = Plane(LAMBERT), math.radians(turned_deg)
    x0, y0 = plane.forward(*BERGEN)
    less = 1 if layout == "roms" else 0
    found: dict[str, Any] = {}
    for side, (dj, di), (rows, cols) in (
        ("rho", (0.0, 0.0), shape),
        ("u", (0.0, 0.5), (shape[0], shape[1] - less)),
        ("v", (0.5, 0.0), (shape[0] - less, shape[1])),
    ):
        j = np.arange(rows)[:, None] + dj - shape[0] / 2
        i = np.arange(cols)[None, :] + di - shape[1] / 2
        # Cells grow to the north-east, as real grids are stretched.
        j, i = spacing * (j + 0.002 * j * j), spacing * (i + 0.002 * i * i)
        lat, lon = plane.inverse(
            x0 + i * math.cos(turn) - j * math.sin(turn),
            y0 + i * math.sin(turn) + j * math.cos(turn),
        )
        east, north = truth(lat, lon, HOURS[:, None, None])
        u, v = along(east, north, plane.angle(lat, lon, turn))
        found |= {f"lat_{side}": lat, f"lon_{side}": lon, side: u if side == "u" else v}
    return found

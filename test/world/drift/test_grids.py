# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Forecasts on projected and curvilinear grids are those of xarray and pyproj."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drifting import little_memory
from forecasts import HOURS, SPAN, START, START_S, axis, by_flow, written, xarray
from native_forecasts import (
    BERGEN,
    LAMBERT,
    POLAR,
    ROTATED,
    Plane,
    by_pyproj,
    projected,
    staggered,
    truth,
)

from dsse_ros.world.drift.flow_files import read_forecast
from dsse_ros.world.drift.shore import Box
from dsse_ros.world.drift.velocity_pairs import Choice
from dsse_ros.world.scenario.incident import Incident

netcdf = pytest.importorskip("netCDF4")
pyproj = pytest.importorskip("pyproj")
# Most of them take longer than a fifth of a second.
pytestmark = pytest.mark.slow

SOUTH, WEST = BERGEN
HERE = SPAN._replace(box=Box(SOUTH - 0.08, SOUTH + 0.08, WEST - 0.16, WEST + 0.16))
PLACES = [
    (SOUTH + lat, WEST + lon, after_s)
    for lat, lon, after_s in ((0, 0, 1800.0), (0.07, -0.15, 7000.0), (-0.06, 0.12, 17900.0))
]

WIND = {"names": ("x_wind_10m", "y_wind_10m"), "standard": ("x_wind", "y_wind")}
CURRENT = {"names": ("u", "v"), "standard": ("x_sea_water_velocity", "y_sea_water_velocity")}
EASTWARD = {
    "names": ("u", "v"),
    "standard": ("eastward_sea_water_velocity", "northward_sea_water_velocity"),
}
NO_FIGURE = {key: value for key, value in ROTATED.items() if key != "earth_radius"}
PROJECTED: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "lambert, as AROME": ("wind", LAMBERT, {**WIND, "spacing": 2500.0}),
    "polar stereographic, as NorKyst": ("current", POLAR, {**CURRENT, "spacing": 800.0}),
    "polar stereographic in km, as TOPAZ": (
        "current", POLAR, {**CURRENT, "spacing": 800.0, "km": True},
    ),
    "rotated pole, as HIRLAM": ("wind", ROTATED, {**WIND, "spacing": 0.02}),
    "rotated pole without latitudes": (
        "wind", ROTATED, {**WIND, "spacing": 0.02, "with_places": False},
    ),
    "rotated pole without a figure of the Earth": (
        "wind", NO_FIGURE, {**WIND, "spacing": 0.02, "with_places": False},
    ),
    "rows from the north": ("current", POLAR, {**CURRENT, "spacing": 800.0, "down": True}),
    "no latitudes": ("current", POLAR, {**CURRENT, "spacing": 800.0, "with_places": False}),
    "cm/s": ("current", POLAR, {**CURRENT, "spacing": 800.0, "factor": 0.01, "units": "cm/s"}),
}  # fmt: skip


@pytest.mark.parametrize("name", PROJECTED)
def test_a_projected_grid_is_turned_to_east_and_north(tmp_path: Path, name: str) -> None:
    kind, mapping, options = PROJECTED[name]
    if "units" in options:
        pytest.importorskip("cf_xarray.units")
    file = written(projected(mapping, **options), tmp_path)
    flow = read_forecast(kind, file, HERE)
    scale = 1e-3 if options.get("km") else 1.0
    for place in PLACES:
        wanted = np.array(by_pyproj(file, Plane(mapping), options["names"], place, scale))
        found = np.array(by_flow(flow, place))
        assert found == pytest.approx(wanted * options.get("factor", 1.0), abs=5e-4)
        assert found == pytest.approx(truth(*place[:2], place[2] / 3600), abs=2e-3)


def test_velocities_to_the_east_and_north_are_not_turned(tmp_path: Path) -> None:
    dataset = projected(POLAR, **EASTWARD, spacing=800.0, grid_relative=False)
    flow = read_forecast("current", written(dataset, tmp_path), HERE)
    for place in PLACES:
        assert by_flow(flow, place) == pytest.approx(truth(*place[:2], place[2] / 3600), abs=2e-3)


def of_roms(layout: str = "roms", *, places: bool = True) -> Any:
    """A forecast of ROMS, whose components lie on the sides of its cells."""
    fields = staggered(layout)
    dataset = xarray.Dataset(
        coords={
            "ocean_time": axis("ocean_time", HOURS, units=f"hours since {START}"),
            "s_rho": axis("s_rho", [-0.9, -0.5, -0.1], standard_name="ocean_s_coordinate_g2"),
        }
    )
    for side in ("rho", "u", "v"):
        dims = (f"eta_{side}", f"xi_{side}")
        for name in ("lat", "lon"):
            values = (
                fields[f"{name}_{side}"]
                if places or side == "rho"
                else 0 * fields[f"{name}_{side}"]
            )
            word = {"lat": "latitude", "lon": "longitude"}[name]
            dataset[f"{name}_{side}"] = (dims, values, {"standard_name": word})
        if side != "rho":
            values = fields[side][:, None] * np.array([3.0, 2.0, 1.0])[:, None, None]
            dataset[side] = (
                ("ocean_time", "s_rho", *dims), values.astype(np.float32),
                {"units": "m s-1", "coordinates": f"lon_{side} lat_{side} s_rho ocean_time"},
            )  # fmt: skip
    return dataset


@pytest.mark.parametrize(
    ("layout", "places"), [("roms", True), ("nemo", True), ("roms", False), ("nemo", False)]
)
def test_components_on_the_sides_of_cells_are_brought_to_one_place_and_turned(
    tmp_path: Path, layout: str, places: bool
) -> None:
    dataset = of_roms(layout, places=places)
    for variable in dataset.variables.values():
        variable.attrs.pop("coordinates", None)
    flow = read_forecast("current", written(dataset, tmp_path), HERE)
    assert flow.source.endswith("u and v")
    for place in PLACES:
        assert by_flow(flow, place) == pytest.approx(truth(*place[:2], place[2] / 3600), abs=2e-3)


def of_curvilinear(names: tuple[str, str] = ("uo", "vo"), **about: Any) -> Any:
    """Both components at the points of a turned grid, along its axes."""
    fields = staggered("nemo")
    u, v = fields["u"], fields["v"]
    dims = ("y", "x")
    # Of a C grid only u has its place at the points of u; v is computed there from its neighbours.
    v = np.stack([np.roll(component, 1, axis=0) + component for component in v]) / 2
    v = (v + np.roll(v, -1, axis=2)) / 2
    dataset = xarray.Dataset(
        {name: (("time", *dims), values.astype(np.float32)[:, 1:-1, 1:-1],
                {"units": "m s-1", **about})
         for name, values in zip(names, (u, v), strict=True)},
        coords={
            "time": axis("time", HOURS, standard_name="time", units=f"hours since {START}"),
            "nav_lat": (dims, fields["lat_u"][1:-1, 1:-1]),
            "nav_lon": (dims, fields["lon_u"][1:-1, 1:-1]),
        },
    )  # fmt: skip
    return dataset


def test_names_that_models_use_differently_need_their_axes(tmp_path: Path) -> None:
    file = written(of_curvilinear(), tmp_path)
    with pytest.raises(ValueError, match="uo and vo may point to the east and north or along"):
        read_forecast("current", file, HERE)
    flow = read_forecast("current", file, HERE, Choice(axes="grid"))
    for place in PLACES:
        assert by_flow(flow, place) == pytest.approx(truth(*place[:2], place[2] / 3600), abs=3e-3)
    straight = read_forecast("current", file, HERE, Choice(axes="earth"))
    assert by_flow(straight, PLACES[0]) != pytest.approx(by_flow(flow, PLACES[0]), abs=0.05)


def test_a_nemo_file_has_its_components_along_the_grid(tmp_path: Path) -> None:
    file = written(of_curvilinear(("vozocrtx", "vomecrty")), tmp_path)
    flow = read_forecast("current", file, HERE)
    for place in PLACES:
        assert by_flow(flow, place) == pytest.approx(truth(*place[:2], place[2] / 3600), abs=3e-3)


def test_a_projection_with_a_figure_counts_more_than_latitudes_that_contradict_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    dataset = projected(POLAR, **CURRENT, spacing=800.0)
    dataset["latitude"] = dataset["latitude"] + 0.01
    file = written(dataset, tmp_path)
    with caplog.at_level(logging.WARNING):
        flow = read_forecast("current", file, HERE)
    assert "latitude and longitude are up to 1.4 cells from the places of their" in caplog.text
    wanted = by_pyproj(file, Plane(POLAR), ("u", "v"), PLACES[1])
    assert by_flow(flow, PLACES[1]) == pytest.approx(wanted, abs=5e-4)
    # CF attributes without the figure of the Earth are of another grid.
    del dataset["plane"].attrs["earth_radius"]
    dataset["latitude"] = dataset["latitude"] - 0.01
    flow = read_forecast("current", written(dataset, tmp_path, "cf.nc"), HERE)
    assert by_flow(flow, PLACES[1]) == pytest.approx(wanted, abs=2e-3)


def test_a_flow_on_its_own_grid_survives_a_message(tmp_path: Path) -> None:
    file = written(projected(POLAR, **CURRENT, spacing=800.0), tmp_path)
    incident = Incident.read({
        "object": "PIW-1", "search_start": "2026-01-17T13:00Z", "current": {"file": str(file)},
        "seen": {"lat": SOUTH, "lon": WEST, "time": "2026-01-17T12:30Z"},
    })  # fmt: skip
    again = Incident.read(json.loads(json.dumps(incident.to_json(), allow_nan=False)))
    assert again == incident and by_flow(again.current, PLACES[0]) == by_flow(
        incident.current, PLACES[0]
    )


def test_of_a_large_curvilinear_grid_only_what_is_needed_takes_memory(tmp_path: Path) -> None:
    """Its latitudes and longitudes are 144 MB of float64, without what is computed of them."""
    read_forecast("current", written(of_roms(), tmp_path, "first.nc"), HERE)
    side, step = 3000, 1e-3
    file = tmp_path / "large.nc"
    along = np.arange(side) - side / 2
    with netcdf.Dataset(file, "w") as dataset:
        for name, size in (("time", 2), ("y", side), ("x", side)):
            dataset.createDimension(name, size)
        dataset.createVariable("time", "f8", ("time",))[:] = [0.0, 6.0]
        dataset["time"].units = f"hours since {START}"
        chunks, packed = (50, side), {"zlib": True, "complevel": 1}
        for name, (rows, cols), middle, units in (
            ("nav_lat", (step, 2e-4), SOUTH, "degrees_north"),
            ("nav_lon", (-4e-4, 2 * step), WEST, "degrees_east"),
        ):
            place = dataset.createVariable(name, "f4", ("y", "x"), chunksizes=chunks, **packed)
            place.units = units
            for first in range(0, side, 500):
                part = along[first : first + 500, None]
                place[first : first + 500] = middle + rows * part + cols * along
        for name in ("vozocrtx", "vomecrty"):
            speed = dataset.createVariable(
                name, "f4", ("time", "y", "x"), chunksizes=(1, 100, 100), **packed
            )
            speed.units = "m s-1"
            speed[:, 1300:1700, 1300:1700] = 0.25
    box = Box(SOUTH - 0.01, SOUTH + 0.01, WEST - 0.02, WEST + 0.02)
    with little_memory():
        flow = read_forecast("current", file, HERE._replace(box=box))
    east, north = by_flow(flow, PLACES[0])
    assert np.hypot(east, north) == pytest.approx(0.25 * np.sqrt(2), rel=1e-4)
    assert flow.extent is not None and flow.extent.north_deg > SOUTH + 1.7


def test_names_of_places_by_themselves_do_not_hide_their_units(tmp_path: Path) -> None:
    """ROMS of NOAA: surface currents, and standard names of latitudes that CF does not know."""
    dataset = of_roms().isel(s_rho=-1, drop=True).rename(u="u_sur", v="v_sur")
    for name in ("lat_u", "lat_v", "lon_u", "lon_v"):
        word = "latitude" if name.startswith("lat") else "longitude"
        dataset[name].attrs = {
            "standard_name": f"grid_{word}_at_cell_edges",
            "units": "degree_north" if word == "latitude" else "degree_east",
        }
    flow = read_forecast("current", written(dataset, tmp_path), HERE)
    for place in PLACES:
        assert by_flow(flow, place) == pytest.approx(truth(*place[:2], place[2] / 3600), abs=3e-3)


def of_rotated(mapping: dict[str, Any] = ROTATED, **options: Any) -> Any:
    return projected(mapping, **{**WIND, "names": ("u", "v")}, spacing=0.02, **options)


def test_longitudes_of_a_rotated_pole_may_exceed_180(tmp_path: Path) -> None:
    dataset = of_rotated(with_places=False)
    turned = dataset.assign_coords(x=dataset["x"] + 360.0)
    for name in ("x", "y"):
        turned[name].attrs = dataset[name].attrs
    flow = read_forecast("wind", written(dataset, tmp_path, "plain.nc"), HERE)
    other = read_forecast("wind", written(turned, tmp_path, "turned.nc"), HERE)
    for place in PLACES:
        assert by_flow(other, place) == pytest.approx(by_flow(flow, place), abs=1e-6)


@pytest.mark.parametrize(
    "attributes",
    [
        {**ROTATED, "crs_wkt": pyproj.CRS(4326).to_wkt()},
        {
            "grid_mapping_name": "rotated_latitude_longitude",
            "proj4": "+proj=ob_tran +o_proj=longlat +lon_0=18 +o_lat_p=39.25 +R=6371000 +no_defs",
        },
    ],
)
def test_a_rotated_pole_may_be_stated_as_text(tmp_path: Path, attributes: dict[str, Any]) -> None:
    dataset = of_rotated(with_places=False)
    flow = read_forecast("wind", written(dataset, tmp_path, "plain.nc"), HERE)
    dataset["plane"].attrs = attributes
    other = read_forecast("wind", written(dataset, tmp_path, "text.nc"), HERE)
    for place in PLACES:
        assert by_flow(other, place) == pytest.approx(by_flow(flow, place), abs=1e-6)


def with_names_of_the_globe(linked: bool) -> Any:
    """A rotated grid whose axes are called latitude and longitude."""
    dataset = of_rotated(with_places=False)
    dataset["y"].attrs = {"standard_name": "latitude", "units": "degrees_north"}
    dataset["x"].attrs = {"standard_name": "longitude", "units": "degrees_east"}
    for name in ("u", "v"):
        if not linked:
            del dataset[name].attrs["grid_mapping"]
    return dataset


def moved(degrees: float) -> Any:
    dataset = of_rotated()
    attributes = dataset["latitude"].attrs
    return dataset.assign_coords(latitude=(dataset["latitude"] + degrees).assign_attrs(attributes))


OF_ROTATED: dict[str, tuple[Any, str]] = {
    "names of the globe": (
        lambda: with_names_of_the_globe(True), "u must have grid_latitude and grid_longitude, got",
    ),
    "names of the globe, not linked": (
        lambda: with_names_of_the_globe(False), "u must have grid_latitude and grid_longitude, got",
    ),
    "a projection that rotates nothing": (
        lambda: of_rotated(with_places=False).assign_coords(
            plane=xarray.DataArray(0, attrs={"grid_mapping_name": "latitude_longitude"})
        ),
        "projection latitude_longitude must be one of CF: got undefined, which projects and rotat",
    ),
    "no projection": (
        lambda: of_rotated(with_places=False).drop_vars("plane"),
        "u must have latitudes and longitudes, or the coordinates of a projection",
    ),
    "other latitudes": (
        lambda: moved(2.0), "latitude and longitude must be the places of their projection, got 10",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", OF_ROTATED)
def test_a_rotated_pole_is_never_read_at_the_wrong_place(tmp_path: Path, name: str) -> None:
    make, message = OF_ROTATED[name]
    file = written(make(), tmp_path)
    # The place whose latitude and longitude are the rotated ones of a point of the grid.
    dataset = of_rotated(with_places=False)
    y, x = (float(dataset[axis][20]) for axis in ("y", "x"))
    for lat, lon in ((y, x), BERGEN):
        box = Box(lat - 0.05, lat + 0.05, lon - 0.05, lon + 0.05)
        with pytest.raises(ValueError) as error:
            read_forecast("wind", file, HERE._replace(box=box))
        assert message in str(error.value) and "\n" not in str(error.value)


REFUSED: dict[str, tuple[Any, str]] = {
    "elsewhere": (
        lambda: projected(POLAR, **CURRENT, spacing=800.0, count=4),
        "file must cover latitude within 59.9200 to 59.9400 and longitude within",
    ),
    "an unknown projection": (
        lambda: (
            projected(POLAR, **CURRENT, spacing=800.0)
            .assign_coords(plane=xarray.DataArray(0, attrs={"grid_mapping_name": "of_my_own"}))
            .drop_vars(["latitude", "longitude"])
        ),
        "projection of_my_own must be one of CF",
    ),
    "no places": (
        lambda: of_curvilinear().drop_vars(["nav_lat", "nav_lon"]),
        "uo must have latitudes and longitudes, or the coordinates of a projection, got the dim",
    ),
    "places that do not differ": (
        lambda: of_roms(places=False).drop_vars(["lat_rho", "lon_rho"]),
        "components must have latitudes and longitudes that differ",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_grid_that_is_not_understood_is_refused_in_a_line(tmp_path: Path, name: str) -> None:
    make, message = REFUSED[name]
    file = written(make(), tmp_path)
    box = Box(SOUTH - 0.28, SOUTH - 0.26, WEST, WEST + 0.01) if name == "elsewhere" else HERE.box
    with pytest.raises(ValueError) as error:
        read_forecast("current", file, HERE._replace(box=box))
    assert message in str(error.value) and "\n" not in str(error.value)


def test_a_place_off_the_grid_is_refused_as_such(tmp_path: Path) -> None:
    file = written(projected(POLAR, **CURRENT, spacing=800.0, count=20), tmp_path)
    flow = read_forecast("current", file, HERE)
    times = START_S + np.array([1800.0, 3600.0])
    assert np.isnan(by_flow(flow, (SOUTH + 0.079, WEST, 1800.0))).all()
    reason = flow.why_none(SOUTH + 0.079, WEST, *times)
    assert reason.startswith("it covers 2026-01-17T12:00:00Z to 2026-01-17T18:00:00Z, 60.1")

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""One small file of each service, with the dimensions, variables and attributes of its header.

Values and places are made up.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from forecasts import HOURS, LATS, LONS, PLACES, SPAN, START_S, by_flow, xarray

from dsse_ros.world.drift.flow import seconds
from dsse_ros.world.drift.flow_files import read_forecast
from dsse_ros.world.drift.velocity_pairs import ANY, Choice

Header = dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]]
"""Dimensions, values and attributes by variable."""
HALF = (LATS[1] - LATS[0]) / 2
TIMES_S = START_S + 3600.0 * HOURS


def truth(lat: Any, lon: Any, hours: Any = HOURS[:, None, None], speed: float = 0.5) -> Any:
    """East and north in m/s, linear along each axis."""
    return speed * (lat + 24 + 0.1 * hours), speed * (lon + 46 - 0.1 * hours)


def grid(down: float = 0.0, right: float = 0.0, rows: int = 17, cols: int = 17) -> Any:
    """Latitudes and longitudes of points, some halves of a cell away."""
    lats, lons = LATS[:rows] + down * HALF, LONS[:cols] + right * HALF
    return np.meshgrid(lats, lons, indexing="ij")


def dataset_of(header: Header, **attributes: Any) -> Any:
    return xarray.Dataset({
        name: (dims, np.asarray(values), about) for name, (dims, values, about) in header.items()
    }, attrs=attributes)  # fmt: skip


def of_era5(folder: Path) -> list[Path]:
    dims = ("valid_time", "latitude", "longitude")
    of_grib = {
        "GRIB_dataType": "an", "GRIB_numberOfPoints": 289, "GRIB_typeOfLevel": "surface",
        "GRIB_stepUnits": 1, "GRIB_stepType": "instant", "GRIB_gridType": "regular_ll",
        "GRIB_uvRelativeToGrid": 0, "GRIB_NV": 0, "GRIB_cfName": "unknown", "GRIB_surface": 0.0,
        "GRIB_missingValue": 3.40282346638529e38, "GRIB_iScansNegatively": 0,
        "standard_name": "unknown", "coordinates": "number valid_time latitude longitude expver",
    }  # fmt: skip
    header: Header = {
        "number": ((), 0, {"units": "1", "standard_name": "realization"}),
        "valid_time": (dims[:1], TIMES_S.astype("i8"), {
            "long_name": "time", "standard_name": "time", "units": "seconds since 1970-01-01",
            "calendar": "proleptic_gregorian"}),
        "latitude": (dims[1:2], LATS[::-1], {"units": "degrees_north",
                     "standard_name": "latitude", "stored_direction": "decreasing"}),
        "longitude": (dims[2:], LONS, {"units": "degrees_east", "standard_name": "longitude"}),
        "expver": (dims[:1], np.array(["0001"] * 7, dtype=object), {}),
        "t2m": (dims, np.full((7, 17, 17), 290.0, "f4"), {**of_grib, "units": "K"}),
    }  # fmt: skip
    lat, lon = grid()
    for name, axis, values in zip(("u10", "v10"), "UV", truth(lat[::-1], lon), strict=True):
        header[name] = dims, values.astype("f4"), {
            **of_grib, "units": "m s**-1", "GRIB_units": "m s**-1", "GRIB_cfVarName": name,
            "GRIB_name": f"10 metre {axis} wind component", "GRIB_shortName": f"10{axis.lower()}",
            "long_name": f"10 metre {axis} wind component",
        }  # fmt: skip
    dataset = dataset_of(
        header, GRIB_centre="ecmf", GRIB_subCentre=0, Conventions="CF-1.7",
        institution="European Centre for Medium-Range Weather Forecasts",
        history="2026-09-25T15:06 GRIB to CDM+CF via cfgrib-0.9.15.1/ecCodes-2.48.2",
    )  # fmt: skip
    for name in ("t2m", "u10", "v10"):
        dataset[name].encoding["coordinates"] = dataset[name].attrs.pop("coordinates")
    path = folder / "data_stream-oper_stepType-instant.nc"
    dataset.to_netcdf(path, engine="netcdf4")
    return [path]


def of_norkyst(folder: Path) -> list[Path]:
    pyproj = pytest.importorskip("pyproj")
    mapping = {
        "grid_mapping_name": "polar_stereographic", "straight_vertical_longitude_from_pole": 70.0,
        "latitude_of_projection_origin": 90.0, "standard_parallel": 60.0,
        "false_easting": 3192800.0, "false_northing": 1784000.0,
        "proj4": "+proj=stere +ellps=WGS84 +lat_0=90.0 +lat_ts=60.0 +x_0=3192800 +y_0=1784000 "
        "+lon_0=70",
    }  # fmt: skip
    plane = pyproj.Transformer.from_crs(4326, mapping["proj4"], always_xy=True)
    x0, y0 = plane.transform(NORTH[1], NORTH[0])
    x, y = (800.0 * np.round(at / 800) + 800.0 * np.arange(-30, 31) for at in (x0, y0))
    lon, lat = plane.transform(*np.meshgrid(x, y), direction="INVERSE")
    dims = ("time", "depth", "Y", "X")
    layer = np.array([1.0, 0.5])[:, None, None]
    header: Header = {
        "time": (dims[:1], TIMES_S, {"long_name": "time since initialization",
                 "units": "seconds since 1970-01-01 00:00:00", "standard_name": "time"}),
        "depth": (dims[1:2], [0.0, 3.0], {"standard_name": "depth", "units": "m",
                  "positive": "down", "axis": "Z"}),
        "Y": (dims[2:3], y, {"standard_name": "projection_y_coordinate", "units": "m"}),
        "X": (dims[3:], x, {"standard_name": "projection_x_coordinate", "units": "m"}),
        "lat": (dims[2:], lat, {"standard_name": "latitude", "units": "degree_north"}),
        "lon": (dims[2:], lon, {"standard_name": "longitude", "units": "degree_east"}),
        "projection_stere": ((), 0, mapping),
    }  # fmt: skip
    sides = truth(lat - NORTH[0] - 24, lon - NORTH[1] - 46)
    for name, word, values in zip(("u_eastward", "v_northward"), ("eastward", "northward"), sides,
                                  strict=True):  # fmt: skip
        header[name] = dims, values[:, None] * layer, {
            "standard_name": f"{word}_sea_water_velocity", "units": "meter second-1",
            "grid_mapping": "projection_stere", "time": "ocean_time",
        }  # fmt: skip
    for name, axis in (("u", "x"), ("v", "y")):
        header[name] = dims, 9 + 0 * sides[0][:, None] * layer, {
            "long_name": f"{name}-momentum component along {axis}-axis",
            "standard_name": f"sea_water_{axis}_velocity", "units": "meter second-1",
            "grid_mapping": "projection_stere",
        }  # fmt: skip
    dataset = dataset_of(header, Conventions="CF-1.4", institution="Institute of Marine Research")
    packed = {"dtype": "i2", "scale_factor": 1e-3, "_FillValue": -32767}
    path = folder / "NorKyst-800m_ZDEPTHS_his.nc"
    names = ("u", "v", "u_eastward", "v_northward")
    dataset.to_netcdf(path, engine="netcdf4", encoding=dict.fromkeys(names, packed))
    return [path]


def of_roms(folder: Path) -> list[Path]:
    lat, lon = grid()
    since = seconds("1968-05-23T00:00")
    header: Header = {
        "ocean_time": (("ocean_time",), TIMES_S - since, {
            "long_name": "time since initialization",
            "units": "seconds since 1968-05-23 00:00:00 GMT", "calendar": "gregorian"}),
        "s_rho": (("s_rho",), [-0.9, -0.5, -0.1], {
            "long_name": "S-coordinate at RHO-points", "valid_min": -1.0, "valid_max": 0.0,
            "standard_name": "ocean_s_coordinate",
            "formula_terms": "s: s_rho eta: zeta depth: h a: theta_s b: theta_b depth_c: hc"}),
        "hc": ((), 5.0, {"long_name": "S-coordinate parameter, critical depth", "units": "meter"}),
        "zeta": (("ocean_time", "eta_rho", "xi_rho"), 0 * HOURS[:, None, None] + 0 * lat, {
            "long_name": "free-surface", "units": "meter", "coordinates": "lat_rho lon_rho"}),
        "grid": ((), 0, {"cf_role": "grid_topology", "topology_dimension": 2}),
    }  # fmt: skip
    share = np.array([0.2, 0.6, 1.0])[:, None, None]
    points = {"rho": grid(), "u": grid(right=1.0, cols=16), "v": grid(down=1.0, rows=16)}
    for side, (lats, lons) in points.items():
        for word, values, units in (("lat", lats, "north"), ("lon", lons, "east")):
            about = {"long_name": f"{word}itude of {side}-points", "units": f"degree_{units}"}
            header[f"{word}_{side}"] = (f"eta_{side}", f"xi_{side}"), values, about
    for number, side in enumerate("uv"):
        values = truth(*points[side])[number]
        values = np.broadcast_to(values, (7, *points[side][0].shape))
        header[side] = ("ocean_time", "s_rho", f"eta_{side}", f"xi_{side}"), (
            values[:, None] * share
        ).astype("f4"), {
            "long_name": f"{side}-momentum component", "units": "meter second-1",
            "grid": "grid", "location": f"edge{number + 1}",
        }  # fmt: skip
    dataset = dataset_of(header, Conventions="CF-1.0", title="ROMS/TOMS 2.2")
    for side in "uv":
        dataset[side].encoding["coordinates"] = f"lat_{side} lon_{side}"
    del dataset["zeta"].attrs["coordinates"]
    dataset.to_netcdf(folder / "ocean_his.nc", engine="netcdf4")
    return [folder / "ocean_his.nc"]


def of_nemo(folder: Path) -> list[Path]:
    since = seconds("1900-01-01T00:00")
    layers = np.array([1.0, 0.4])[:, None, None]
    files = []
    for number, (side, axis, shift) in enumerate((("u", "x", (0, 1)), ("v", "y", (1, 0)))):
        lat, lon = grid(*shift)
        depth, name = f"depth{side}", f"{side}o"
        time = {"standard_name": "time", "units": "seconds since 1900-01-01 00:00:00",
                "calendar": "gregorian"}  # fmt: skip
        model = {"nav_model": f"grid_{side.upper()}"}
        values = np.broadcast_to(truth(lat, lon)[number], (7, 17, 17))[:, None] * layers
        header: Header = {
            "nav_lat": (("y", "x"), lat.astype("f4"), {"standard_name": "latitude",
                        "units": "degrees_north", **model}),
            "nav_lon": (("y", "x"), lon.astype("f4"), {"standard_name": "longitude",
                        "units": "degrees_east", **model}),
            depth: ((depth,), [0.506, 1.556], {
                "standard_name": "depth", "long_name": f"Vertical {side.upper()} levels",
                "units": "m", "axis": "Z", "positive": "down", "bounds": f"{depth}_bounds"}),
            f"{depth}_bounds": ((depth, "axis_nbounds"), [[0, 1.0], [1.0, 2.1]], {"units": "m"}),
            "time_centered": (("time_counter",), TIMES_S - since, time),
            "time_counter": (("time_counter",), TIMES_S - since, {**time, "axis": "T"}),
            name: (("time_counter", depth, "y", "x"), values.astype("f4"), {
                "standard_name": f"sea_water_{axis}_velocity", "units": "m/s",
                "long_name": f"Sea Water {axis.upper()} Velocity", "online_operation": "average",
                "interval_operation": "2700 s", "cell_methods": "time: mean (interval: 2700 s)"}),
        }  # fmt: skip
        dataset = dataset_of(header)
        dataset[name].encoding["coordinates"] = "time_centered nav_lat nav_lon"
        dataset[name].encoding["_FillValue"] = np.float32(1e20)
        files.append(folder / f"nemo_1h_grid-{side.upper()}.nc")
        dataset.to_netcdf(files[-1], engine="netcdf4")
    return files


def of_wrf(folder: Path) -> list[Path]:
    lat, lon = grid()
    dims = ("Time", "south_north", "west_east")
    times = [f"2026-01-17_{12 + hour:02.0f}:00:00" for hour in HOURS]
    surface = {"FieldType": 104, "MemoryOrder": "XY ", "stagger": ""}
    header: Header = {"Times": (("Time",), np.array(times, "S19"), {})}
    for name, values, words, units in (
        ("XLAT", lat, "LATITUDE, SOUTH IS NEGATIVE", "degree_north"),
        ("XLONG", lon, "LONGITUDE, WEST IS NEGATIVE", "degree_east"),
    ):
        about = {**surface, "description": words, "units": units}
        header[name] = dims, np.broadcast_to(values, (7, *lat.shape)).astype("f4"), about
    for side, values in zip("UV", truth(lat, lon), strict=True):
        about = {**surface, "description": f"{side} at 10 M", "units": "m s-1"}
        header[f"{side}10"] = dims, values.astype("f4"), about
    for side, stagger, shape in (("U", "X", (17, 18)), ("V", "Y", (18, 17))):
        own = [f"{dim}_stag" if size == 18 else dim for dim, size in zip(dims[1:], shape,
               strict=True)]  # fmt: skip
        header[side] = ("Time", "bottom_top", *own), np.full((7, 2, *shape), 30, "f4"), {
            "FieldType": 104, "MemoryOrder": "XYZ", "units": "m s-1", "stagger": stagger,
            "description": f"{stagger.lower()}-wind component",
        }  # fmt: skip
    dataset = dataset_of(header, TITLE=" OUTPUT FROM WRF V4.5 MODEL", MAP_PROJ=6)
    dataset.to_netcdf(folder / "wrfout_d01_2026-01-17", format="NETCDF3_64BIT")
    return [folder / "wrfout_d01_2026-01-17"]


def of_hf_radar(folder: Path) -> list[Path]:
    lat, lon = grid()
    dims = ("time", "lat", "lon")
    header: Header = {
        "lat": (("lat",), LATS.astype("f4"), {"standard_name": "latitude",
                "units": "degrees_north"}),
        "lon": (("lon",), LONS.astype("f4"), {"standard_name": "longitude",
                "units": "degrees_east"}),
        "time": (("time",), TIMES_S.astype("i4"), {"standard_name": "time",
                 "units": "seconds since 1970-01-01", "calendar": "gregorian"}),
        "site_lat": (("nSites",), [-24.0, -23.5], {"standard_name": "latitude",
                     "long_name": "Contributing radar site latitudes", "units": "degrees_north"}),
        "site_lon": (("nSites",), [-47.0, -46.5], {"standard_name": "longitude",
                     "long_name": "Contributing radar site longitudes", "units": "degrees_east"}),
        "DOPx": (dims, np.ones((7, 17, 17), "f4"), {"units": "1",
                 "long_name": "longitudinal dilution of precision"}),
    }  # fmt: skip
    for name, word, values in zip("uv", ("eastward", "northward"), truth(lat, lon), strict=True):
        values = np.array(np.broadcast_to(values, (7, 17, 17)))
        values[:, :3, :3] = np.nan
        header[name] = dims, values, {
            "standard_name": f"surface_{word}_sea_water_velocity", "units": "m s-1",
            "ancillary_variables": "DOPx",
        }  # fmt: skip
    packed = {"dtype": "i2", "scale_factor": 0.001, "_FillValue": -32768}
    dataset = dataset_of(header, Conventions="CF-1.4", id="HFRNet")
    dataset.to_netcdf(folder / "rtv.nc", format="NETCDF3_CLASSIC",
                      encoding={"u": packed, "v": packed})  # fmt: skip
    return [folder / "rtv.nc"]


def of_gfs(folder: Path) -> list[Path]:
    eccodes = pytest.importorskip("eccodes")
    lat, lon = grid()
    header = {
        "centre": "kwbc", "subCentre": 0, "tablesVersion": 2, "significanceOfReferenceTime": 1,
        "productionStatusOfProcessedData": 0, "typeOfProcessedData": 1, "shapeOfTheEarth": 6,
        "Ni": 17, "Nj": 17, "latitudeOfFirstGridPointInDegrees": LATS[-1],
        "latitudeOfLastGridPointInDegrees": LATS[0], "iScansNegatively": 0, "jScansPositively": 0,
        "longitudeOfFirstGridPointInDegrees": LONS[0] + 360, "generatingProcessIdentifier": 96,
        "longitudeOfLastGridPointInDegrees": LONS[-1] + 360, "typeOfGeneratingProcess": 2,
        "iDirectionIncrementInDegrees": 0.125, "jDirectionIncrementInDegrees": 0.125,
        "dataDate": 20260117, "dataTime": 1200, "bitsPerValue": 16,
    }  # fmt: skip
    # Category and number of the parameter, type of the surface, its scale and value.
    fields = {
        "PRMSL": (3, 1, 101, 0, 0), "GUST": (2, 22, 1, 0, 0), "TMP": (0, 0, 103, 0, 2),
        "UGRD PBL": (2, 2, 220, 0, 0), "VGRD PBL": (2, 3, 220, 0, 0),
        "UGRD 850": (2, 2, 100, 0, 85000), "VGRD 850": (2, 3, 100, 0, 85000),
        "UGRD 100 m": (2, 2, 103, 0, 100), "VGRD 100 m": (2, 3, 103, 0, 100),
        "UGRD": (2, 2, 103, 0, 10), "VGRD": (2, 3, 103, 0, 10),
    }  # fmt: skip
    keys = ("parameterCategory", "parameterNumber", "typeOfFirstFixedSurface",
            "scaleFactorOfFirstFixedSurface", "scaledValueOfFirstFixedSurface")  # fmt: skip
    path = folder / "gfs.t12z.pgrb2.0p25"
    with path.open("wb") as file:
        for hour in HOURS.astype(int):
            sides = dict(zip(("UGRD", "VGRD"), truth(lat[::-1], lon, hour), strict=True))
            for name, product in fields.items():
                message = eccodes.codes_grib_new_from_samples("regular_ll_sfc_grib2")
                for key, value in {**header, **dict(zip(keys, product, strict=True))}.items():
                    eccodes.codes_set(message, key, value)
                eccodes.codes_set(message, "forecastTime", int(hour))
                values = sides.get(name, np.full(lat.shape, 40.0) + lat)
                eccodes.codes_set_values(message, np.asarray(values, float).ravel())
                eccodes.codes_write(message, file)
                eccodes.codes_release(message)
    return [path]


NORTH = (60.2, 4.5)
SERVICES: dict[str, tuple[str, Callable[[Path], list[Path]], Choice]] = {
    "GFS": ("wind", of_gfs, ANY),
    "ERA5": ("wind", of_era5, ANY),
    "NorKyst": ("current", of_norkyst, ANY),
    "ROMS": ("current", of_roms, ANY),
    "NEMO": ("current", of_nemo, ANY),
    "WRF": ("wind", of_wrf, ANY),
    "HF radar": ("current", of_hf_radar, ANY),
}


@pytest.mark.parametrize("service", SERVICES)
def test_a_file_with_the_header_of_a_service_is_read_right(tmp_path: Path, service: str) -> None:
    kind, write, choice = SERVICES[service]
    south, west = NORTH if service == "NorKyst" else (-24.0, -46.0)
    box = type(SPAN.box)(south - 0.1, south + 0.1, west - 0.1, west + 0.1)
    files = write(tmp_path)
    flow = read_forecast(kind, files, SPAN._replace(box=box), choice)
    for _, _, after_s in PLACES:
        for lat, lon in ((0.0, 0.0), (0.07, -0.09)):
            wanted = truth(lat - 24, lon - 46, after_s / 3600)
            found = by_flow(flow, (south + lat, west + lon, after_s))
            assert found == pytest.approx(wanted, abs=2e-3)

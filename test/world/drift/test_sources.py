# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files as services publish them, made small: the table of sources in docs/drift.md.

Those on other grids and in GRIB are in `test_grids`, `test_meshes` and `test_grib`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from forecasts import (
    HOURS,
    LONS,
    PLACES,
    SPAN,
    START_S,
    axis,
    by_flow,
    by_xarray,
    lattice,
    levels,
    pair,
    velocity,
    written,
    xarray,
)

from dsse_ros.world.drift.flow import seconds
from dsse_ros.world.drift.flow_files import read_forecast

Encoding = dict[str, Any]
PACKED: Encoding = {"dtype": "i2", "scale_factor": 1e-3, "_FillValue": -30000}


def of_era5() -> tuple[Any, dict[str, Encoding]]:
    """The Climate Data Store: latitudes from the north, experiment and member as coordinates."""
    dataset = pair("wind", ("u10", "v10"), scale=5.0, standard=False, GRIB_typeOfLevel="surface")
    times = START_S + 3600.0 * HOURS
    dataset = dataset.rename(time="valid_time", lat="latitude", lon="longitude")
    dataset = dataset.assign_coords(
        valid_time=axis("valid_time", times.astype(np.int64), standard_name="time",
                        units="seconds since 1970-01-01"),
        number=0, expver=("valid_time", ["0001"] * 5 + ["0005"] * 2),
    )  # fmt: skip
    return dataset.isel(latitude=slice(None, None, -1)), {}


def of_copernicus() -> tuple[Any, dict[str, Encoding]]:
    """Copernicus Marine: a depth of half a metre, packed, hours since 1950."""
    dataset = levels(pair("current", ("uo", "vo")), "depth", [0.494], [1.0], units="m",
                     standard_name="depth", positive="down")  # fmt: skip
    since = (START_S - seconds("1950-01-01T00:00")) / 3600
    time = axis("time", HOURS + since, standard_name="time", units="hours since 1950-01-01")
    return dataset.assign_coords(time=time), {"uo": PACKED, "vo": PACKED}


def of_hycom() -> tuple[Any, dict[str, Encoding]]:
    """HYCOM: longitudes from 0, several depths, packed in mm/s."""
    dataset = pair("current", ("water_u", "water_v"), lattice(lons=LONS + 360.0))
    dataset = levels(dataset, "depth", [0.0, 2.0, 4.0], [1.0, 0.5, 0.2], units="m", positive="down")
    return dataset, {"water_u": PACKED, "water_v": PACKED}


def of_hf_radar() -> tuple[Any, dict[str, Encoding]]:
    """The European network of HF radars: EWCT and NSCT, with gaps."""
    names = dict(zip(("EWCT", "NSCT"), velocity(lattice()), strict=True))
    variables = {
        name: values.transpose("time", "lat", "lon").astype(np.float32).expand_dims("depth", 1)
        for name, values in names.items()
    }
    for word, values in zip(("eastward", "northward"), variables.values(), strict=True):
        values.attrs = {"units": "m s-1", "standard_name": f"surface_{word}_sea_water_velocity"}
        values[..., :2, :2] = np.nan
    depth = axis("depth", [0.0], standard_name="depth", units="m", positive="down")
    return xarray.Dataset(variables, coords={**lattice(), "depth": depth}), {}


def of_wgrib2() -> tuple[Any, dict[str, Encoding]]:
    """GFS as NetCDF by wgrib2, with names of NCEP."""
    names = ("UGRD_10maboveground", "VGRD_10maboveground")
    long_name = "Wind Component, 10 m above ground"
    dataset = pair("wind", names, lattice(lons=LONS + 360), standard=False, long_name=long_name)
    return dataset, {}


def of_cmip() -> tuple[Any, dict[str, Encoding]]:
    """CMIP and CORDEX: `uas` with a scalar height."""
    dataset = pair("wind", ("uas", "vas"), scale=5.0)
    height = xarray.DataArray(10.0, attrs={"standard_name": "height", "units": "m"})
    return dataset.assign_coords(height=height), {}


def of_waves() -> tuple[Any, dict[str, Encoding]]:
    """Waves of Copernicus Marine: the Stokes drift, beside others."""
    stokes = pair("current", ("VSDX", "VSDY"), scale=0.2)
    for word, name in (("x", "VSDX"), ("y", "VSDY")):
        stokes[name].attrs["standard_name"] = f"sea_surface_wave_stokes_drift_{word}_velocity"
    return stokes.assign(VHM0=stokes["VSDX"].assign_attrs(standard_name="wave_height")), {}


SOURCES: dict[str, tuple[str, Callable[[], Any], tuple[str, str], dict[str, Any]]] = {
    "ERA5": ("wind", of_era5, ("u10", "v10"), {}),
    "Copernicus Marine": ("current", of_copernicus, ("uo", "vo"), {"depth": 0.494}),
    "HYCOM": ("current", of_hycom, ("water_u", "water_v"), {"depth": 0.0}),
    "waves of Copernicus Marine": ("waves", of_waves, ("VSDX", "VSDY"), {}),
    "HF radar": ("current", of_hf_radar, ("EWCT", "NSCT"), {"depth": 0.0}),
    "GFS by wgrib2": ("wind", of_wgrib2, ("UGRD_10maboveground", "VGRD_10maboveground"), {}),
    "CMIP": ("wind", of_cmip, ("uas", "vas"), {}),
}


@pytest.mark.parametrize("name", SOURCES)
def test_a_file_of_a_service_is_read_right(tmp_path: Path, name: str) -> None:
    kind, make, names, where = SOURCES[name]
    dataset, encoding = make()
    file = tmp_path / "forecast.nc"
    dataset.to_netcdf(file, engine="netcdf4", encoding=encoding)
    flow = read_forecast(kind, file, SPAN)
    for lat, lon, after_s in PLACES:
        there = (lat, lon + 360 if name in ("HYCOM", "GFS by wgrib2") else lon, after_s)
        wanted = by_xarray(file, names, there, **where)
        assert by_flow(flow, (lat, lon, after_s)) == pytest.approx(wanted, abs=1e-4)


def of_wrf(dataset: Any) -> Any:
    """A `wrfout` file: times as text, places for each time, names in capitals."""
    times = [f"2026-01-17_{12 + hour:02d}:00:00" for hour in range(len(HOURS))]
    lat, lon = np.meshgrid(dataset["lat"], dataset["lon"], indexing="ij")
    shape, dims = (len(times), *lat.shape), ("Time", "south_north", "west_east")
    variables = {"Times": (("Time",), np.array(times, "S19"))}
    for name, values, units in (("XLAT", lat, "degree_north"), ("XLONG", lon, "degree_east")):
        variables[name] = dims, np.broadcast_to(values, shape).astype("f4"), {"units": units}
    for side, name in (("u", "U10"), ("v", "V10")):
        about = {"units": "m s-1", "description": f"{side.upper()} at 10 M"}
        variables[name] = dims, dataset[f"{side}10"].transpose("time", ...).values, about
    return xarray.Dataset(variables)


def test_a_file_of_wrf_is_read_right(tmp_path: Path) -> None:
    dataset = pair("wind", ("u10", "v10"), standard=False)
    plain = written(dataset, tmp_path, "plain.nc")
    flow = read_forecast("wind", written(of_wrf(dataset), tmp_path, "wrfout_d01"), SPAN)
    for place in PLACES:
        wanted = by_xarray(plain, ("u10", "v10"), place)
        assert by_flow(flow, place) == pytest.approx(wanted, abs=1e-3)
    moving = of_wrf(dataset)
    moving["XLAT"].values[-1] += 0.1
    with pytest.raises(ValueError, match="XLAT must be the same at all times"):
        read_forecast("wind", written(moving, tmp_path, "nest.nc"), SPAN)
    wrong = of_wrf(dataset)
    wrong["Times"] = wrong["Times"].str.replace(b"_", b" at ")
    with pytest.raises(ValueError, match="Times must have times like 2026-01-17_12:00:00, got"):
        read_forecast("wind", written(wrong, tmp_path, "times.nc"), SPAN)

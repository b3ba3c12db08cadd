# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The wind at 10 m and the current at the surface are found, or the file is refused in a line."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from forecasts import (
    PLACES,
    SPAN,
    axis,
    by_flow,
    by_xarray,
    lattice,
    levels,
    pair,
    written,
    xarray,
)

from dsse_ros.world.drift.flow_files import read_forecast
from dsse_ros.world.drift.velocity_pairs import Choice


def wind(names: tuple[str, str] = ("u", "v"), **options: Any) -> Any:
    return pair("wind", names, scale=5.0, **options)


def current(names: tuple[str, str] = ("uo", "vo"), **options: Any) -> Any:
    return pair("current", names, **options)


def with_scalar(dataset: Any, name: str, value: float, **attributes: Any) -> Any:
    return dataset.assign_coords({name: xarray.DataArray(value, attrs=attributes)})


UNNAMED = {"standard": False}
METRES_UP = {"units": "m", "positive": "up"}
PASCAL = {"units": "Pa", "positive": "down"}


def of_gfs() -> Any:
    """Pressure levels first, then heights, as THREDDS serves GFS."""
    high = levels(wind(("u_isobaric", "v_isobaric")), "isobaric", [25e3, 1e5], [8, 1], **PASCAL)
    low = levels(
        wind(("u_height_above_ground", "v_height_above_ground")),
        "height_above_ground", [80, 10], [2, 1], **METRES_UP,
    )  # fmt: skip
    return xarray.merge([high, low])


RIGHT: dict[str, tuple[str, Callable[[], Any], tuple[str, str], dict[str, Any]]] = {
    "heights, 10 m among them": ("wind", of_gfs, ("u_height_above_ground", "v_height_above_ground"),
                                 {"height_above_ground": 10}),
    "u10 without a name beside u100 with one": (
        "wind",
        lambda: xarray.merge([wind(("u100", "v100")), wind(("u10", "v10"), **UNNAMED) * 0.5]),
        ("u10", "v10"), {},
    ),
    "a scalar height": (
        "wind", lambda: with_scalar(wind(("uas", "vas")), "height", 10.0, **METRES_UP),
        ("uas", "vas"), {},
    ),
    "a long name": (
        "wind", lambda: wind(("ua", "va"), long_name="component of wind at 10 metres"),
        ("ua", "va"), {},
    ),
    "depths, the deepest first": (
        "current",
        lambda: levels(current(), "depth", [50, 10, 0.5], [3, 2, 1], units="m", positive="down"),
        ("uo", "vo"), {"depth": 0.5},
    ),
    "sigma layers from the bottom": (
        "current",
        lambda: levels(current(), "s_rho", [-0.9, -0.5, -0.1], [3, 2, 1],
                       standard_name="ocean_s_coordinate_g2"),
        ("uo", "vo"), {"s_rho": -0.1},
    ),
    "a name beside a level of no stated kind": (
        "wind", lambda: with_scalar(wind(("u10", "v10"), **UNNAMED), "lev", 0.0),
        ("u10", "v10"), {},
    ),
    "a name beside unlinked levels, 10 m among them": (
        "wind",
        lambda: unlinked("height", 10.0, **METRES_UP).assign(
            plev=xarray.DataArray(85000.0, attrs={"units": "Pa"})
        ),
        ("u10", "v10"), {},
    ),
    "names of NetCDF-Java": (
        "wind",
        lambda: levels(
            wind(tuple(f"{side}-component_of_wind_height_above_ground" for side in "uv"),
                 **UNNAMED),
            "height_above_ground4", [80, 10], [2, 1], units="m",
        ),
        tuple(f"{side}-component_of_wind_height_above_ground" for side in "uv"),
        {"height_above_ground4": 10},
    ),
    "names of ERA5 in zarr": (
        "wind",
        lambda: wind(tuple(f"10m_{side}_component_of_wind" for side in "uv"), **UNNAMED),
        tuple(f"10m_{side}_component_of_wind" for side in "uv"), {},
    ),
    "units without a space": (
        "current", lambda: current(units="ms-1"), ("uo", "vo"), {},
    ),
    "heights above the seabed": (
        "current",
        lambda: levels(current(), "z", [1, 40], [0.1, 1], standard_name="height_above_sea_floor"),
        ("uo", "vo"), {"z": 40},
    ),
    "the total beside a part": (
        "current",
        lambda: xarray.merge([current(), current(("utotal", "vtotal"), standard=False) * 2.0]),
        ("utotal", "vtotal"), {},
    ),
    "u and v beside their mean over the depth": (
        "current",
        lambda: xarray.merge([
            current(("u", "v"), **UNNAMED),
            current(("ubar", "vbar"), **UNNAMED, long_name="vertically integrated component") * 3,
        ]),
        ("u", "v"), {},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", RIGHT)
def test_the_right_pair_and_level_are_found(tmp_path: Path, name: str) -> None:
    kind, make, names, where = RIGHT[name]
    dataset = make()
    # Arithmetic drops the units.
    for variable in dataset.data_vars.values():
        variable.attrs.setdefault("units", "m s-1")
    file = written(dataset, tmp_path)
    flow = read_forecast(kind, file, SPAN)
    for place in PLACES:
        assert by_flow(flow, place) == pytest.approx(
            by_xarray(file, names, place, **where), abs=1e-4
        )


def test_what_a_scenario_selects_is_read(tmp_path: Path) -> None:
    members = levels(wind(("u10", "v10")), "number", [0, 1, 2], [1, 2, 3])
    file = written(members, tmp_path)
    with pytest.raises(ValueError, match=r"u10 must have one number, got 3; choose by select"):
        read_forecast("wind", file, SPAN)
    flow = read_forecast("wind", file, SPAN, Choice(select={"number": 2}))
    wanted = by_xarray(file, ("u10", "v10"), PLACES[0], number=2)
    assert by_flow(flow, PLACES[0]) == pytest.approx(wanted, abs=1e-4)
    with pytest.raises(ValueError, match="one of the values of number, 0, 1, 2, got 7"):
        read_forecast("wind", file, SPAN, Choice(select={"number": 7}))
    with pytest.raises(ValueError, match="select must name dimensions of u10 and v10, time, nu"):
        read_forecast("wind", file, SPAN, Choice(select={"expver": 1}))


def test_the_variables_that_a_scenario_names_are_read(tmp_path: Path) -> None:
    file = written(
        xarray.merge([wind(("u100", "v100")), wind(("a", "b"), standard=False)]), tmp_path
    )
    flow = read_forecast("wind", file, SPAN, Choice(("u100", "v100")))
    wanted = by_xarray(file, ("u100", "v100"), PLACES[0])
    assert by_flow(flow, PLACES[0]) == pytest.approx(wanted, abs=1e-4)
    with pytest.raises(ValueError, match="file must have the variable c, got"):
        read_forecast("wind", file, SPAN, Choice(("a", "c")))
    with pytest.raises(ValueError, match="u100 must be a current, got eastward_wind"):
        read_forecast("current", file, SPAN, Choice(("u100", "v100")))


def test_a_choice_among_several_pairs_is_logged(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    total = current(("utotal", "vtotal"), standard=False)
    file = written(xarray.merge([current(), total]), tmp_path)
    with caplog.at_level(logging.WARNING):
        flow = read_forecast("current", file, SPAN)
    assert "takes utotal and vtotal, not uo and vo" in caplog.text
    assert flow.source.endswith("forecast.nc: utotal and vtotal")


def test_units_that_a_scenario_states_count_more_than_those_of_the_file(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    dataset = current()
    dataset["vo"].attrs["units"] = "degrees"
    file = written(dataset, tmp_path)
    with pytest.raises(ValueError, match=r"got uo \(eastward_sea_water_velocity\), vo"):
        read_forecast("current", file, SPAN)
    with caplog.at_level(logging.WARNING):
        flow = read_forecast("current", file, SPAN, Choice(units="m/s"))
    assert "has uo and vo in m/s, not in degrees" in caplog.text
    wanted = by_xarray(file, ("uo", "vo"), PLACES[0])
    assert by_flow(flow, PLACES[0]) == pytest.approx(wanted, abs=1e-4)


def test_a_file_of_one_time_is_constant_for_the_hours_that_a_scenario_states(
    tmp_path: Path,
) -> None:
    whole = written(current(), tmp_path, "whole.nc")
    for name, single in (("axis", [2]), ("scalar", 2)):
        file = written(current().isel(time=single), tmp_path, f"{name}.nc")
        with pytest.raises(ValueError, match="two or more times, .* or state constant_hours"):
            read_forecast("current", file, SPAN)
        flow = read_forecast("current", file, SPAN, Choice(constant_s=3 * 3600))
        for lat, lon, after_s in ((-24.1, -46.2, 1800.0), (-23.8, -45.8, 5 * 3600.0)):
            wanted = by_xarray(whole, ("uo", "vo"), (lat, lon, 7200.0))
            assert by_flow(flow, (lat, lon, after_s)) == pytest.approx(wanted, abs=1e-4)
        # Its last value is that of 17:00.
        assert np.isnan(by_flow(flow, (-24.1, -46.2, 5.1 * 3600))).all()
        with pytest.raises(ValueError, match="must cover time within 2026-01-18T12:30:00Z to"):
            late = SPAN._replace(begin_s=SPAN.begin_s + 86400, end_s=SPAN.end_s + 86400)
            read_forecast("current", file, late, Choice(constant_s=3600))
    with pytest.raises(ValueError, match="constant_hours is for a file of one time, got 7"):
        read_forecast("current", whole, SPAN, Choice(constant_s=3600))


def of_one_time() -> Any:
    return current().isel(time=0)


def unlinked(name: str, value: float, dims: tuple[str, ...] = (), **attributes: Any) -> Any:
    """A wind at 10 m by its name, beside a level that no attribute links to it."""
    values = np.full((1,) * len(dims), value)
    level = xarray.DataArray(values, dims=dims, attrs=attributes)
    return wind(("u10", "v10"), **UNNAMED).assign({name: level})


REFUSED: dict[str, tuple[str, Callable[[], Any], str]] = {
    "pressure levels": (
        "wind",
        lambda: levels(wind(), "plev", [1000, 300], [1, 8], standard_name="air_pressure",
                       units="hPa"),
        "wind must be at 10 m above ground, got u and v at plev 1000, 300 hPa",
    ),
    "hybrid levels": (
        "wind", lambda: levels(wind(), "hybrid", [1, 137], [8, 1], positive="down"),
        "got u and v at hybrid 1, 137",
    ),
    "a single pressure level": (
        "wind", lambda: levels(wind(), "isobaric", [1e5], [1], **PASCAL), "isobaric 100000 Pa",
    ),
    "a scalar pressure": (
        "wind", lambda: with_scalar(wind(), "isobaricInhPa", 850.0, units="hPa"),
        "isobaricInhPa 850 hPa",
    ),
    "a name that a hybrid level contradicts": (
        "wind", lambda: levels(wind(("u10", "v10")), "hybrid", [137], [1], positive="down"),
        "got u10 and v10 at hybrid 137",
    ),
    "a name that a sigma level contradicts": (
        "wind", lambda: with_scalar(wind(("u10", "v10")), "sigma", 0.5), "at sigma 0.5",
    ),
    "a name that a pressure contradicts": (
        "wind", lambda: with_scalar(wind(("u10", "v10")), "lev", 850.0, units="hPa"),
        "at lev 850 hPa",
    ),
    "a name that a height contradicts": (
        "wind", lambda: with_scalar(wind(("u10", "v10")), "height", 100.0, **METRES_UP),
        "at height 100 m",
    ),
    "a name that an unlinked pressure contradicts": (
        "wind", lambda: unlinked("plev", 85000.0, standard_name="air_pressure", units="Pa"),
        "at plev 85000 Pa",
    ),
    "a name that an unlinked hybrid level contradicts": (
        "wind", lambda: unlinked("hybrid", 137.0, ("hybrid",)), "at hybrid 137",
    ),
    "other heights": (
        "wind", lambda: levels(wind(), "height", [80, 100], [1, 2], **METRES_UP),
        "got u and v at height 80, 100 m",
    ),
    "another height in the names": (
        "wind", lambda: wind(("u100", "v100")), "u100 and v100 at 100 m",
    ),
    "two heights of which one is unknown": (
        "wind", lambda: xarray.merge([wind(("u100", "v100")), wind(("u", "v"))]),
        "got u100 and v100 at 100 m; u and v at no stated level",
    ),
    "two winds of one height": (
        "wind", lambda: xarray.merge([wind(("u_a", "v_a")), wind(("u_b", "v_b"))]),
        "wind must be one pair of variables, got u_a and v_a at no stated level; u_b and v_b",
    ),
    "a deep current": (
        "current", lambda: levels(current(), "depth", [50, 100], [1, 2], units="m"),
        "current must be at the surface, got uo and vo at depth 50, 100 m",
    ),
    "sigma layers of the bottom": (
        "current", lambda: levels(current(), "s_rho", [-0.98, -0.92], [1, 2],
                                  standard_name="ocean_s_coordinate"),
        "must be at the surface, got uo and vo at s_rho -0.98, -0.92",
    ),
    "levels of no stated direction": (
        "current", lambda: levels(current(), "z", [1, 40], [1, 2], units="m"), "at z 1, 40 m",
    ),
    "wind as a current": ("current", wind, "got u (eastward_wind), v (northward_wind)"),
    "wind as a current, by its long name": (
        "current", lambda: wind(standard=False, long_name="component of wind"), "component of wind",
    ),
    "the tide alone": (
        "current", lambda: current(standard=False, long_name="tide component"), "tide component",
    ),
    "two halves": (
        "current",
        lambda: xarray.merge([current(("uo", "a")).drop_vars("a"),
                              current(("b", "vtotal")).drop_vars("b")]),
        "got uo (eastward_sea_water_velocity), vtotal (northward_sea_water_velocity)",
    ),
    "components in different units": (
        "current",
        lambda: current().assign(vo=current()["vo"].assign_attrs(units="cm s-1")),
        "got uo (eastward_sea_water_velocity), vo",
    ),
    "a snapshot": (
        "current", of_one_time, "must have two or more times, got only 2026-01-17T12",
    ),
    "one time": (
        "current", lambda: current().isel(time=[0]), "must have two or more times, got only",
    ),
    "no time": (
        "current", lambda: of_one_time().drop_vars("time"),
        "uo must have times, got the dimensions",
    ),
    "two experiments": (
        "wind", lambda: levels(wind(("u10", "v10")), "expver", [1, 5], [1, np.nan]),
        "u10 must have one expver, got 2; choose by select: {expver: ...}",
    ),
    "a rotated grid": (
        "current",
        lambda: current(coordinates=lattice() | {
            "lat": axis("lat", np.arange(3.0), standard_name="grid_latitude", units="degrees"),
            "lon": axis("lon", np.arange(3.0), standard_name="grid_longitude", units="degrees"),
        }),
        "uo must have latitudes and longitudes, or the coordinates of a projection",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_without_the_right_pair_is_refused_in_a_line(tmp_path: Path, name: str) -> None:
    kind, make, message = REFUSED[name]
    file = written(make(), tmp_path)
    with pytest.raises(ValueError) as error:
        read_forecast(kind, file, SPAN)
    assert message in str(error.value) and "forecast.nc" in str(error.value)
    assert "\n" not in str(error.value)

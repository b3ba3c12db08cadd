# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Several files are one forecast: of different times, or of one component each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from forecasts import (
    HOURS,
    LATS,
    PLACES,
    SPAN,
    START,
    START_S,
    by_flow,
    by_xarray,
    lattice,
    levels,
    pair,
    written,
    xarray,
)

from dsse_ros.base.fields import FieldError
from dsse_ros.world.drift.flow_files import read_forecast
from dsse_ros.world.drift.velocity_pairs import Choice
from dsse_ros.world.scenario.incident import Incident

NAMES = ("uo", "vo")


@pytest.fixture
def whole(tmp_path: Path) -> Any:
    """The data set, and the file of all of it."""
    dataset = pair("current", NAMES)
    return dataset, written(dataset, tmp_path, "whole.nc")


def check(files: list[Path], whole: Path) -> None:
    flow = read_forecast("current", [str(file) for file in files], SPAN)
    for place in PLACES:
        wanted = by_xarray(whole, NAMES, place)
        assert by_flow(flow, place) == pytest.approx(wanted, abs=1e-5)


def test_files_of_one_time_each_are_a_series(tmp_path: Path, whole: Any) -> None:
    dataset, file = whole
    # In any order, with time as an axis or as a scalar.
    parts = [
        written(dataset.isel(time=[hour] if hour % 2 else hour), tmp_path, f"{hour}.nc")
        for hour in (3, 0, 1, 6, 2, 5, 4)
    ]
    check(parts, file)


def test_files_of_several_times_are_joined_and_the_last_one_counts(
    tmp_path: Path, whole: Any
) -> None:
    dataset, file = whole
    old = dataset.isel(time=slice(0, 5)).copy(deep=True)
    old["uo"].loc[{"time": slice(2, None)}] += 1.0
    parts = [written(old, tmp_path, "old.nc"), written(dataset.isel(time=slice(2, 7)), tmp_path)]
    check(parts, file)


def test_files_of_one_component_each_are_joined(tmp_path: Path, whole: Any) -> None:
    dataset, file = whole
    check([written(dataset[[name]], tmp_path, f"{name}.nc") for name in NAMES], file)
    halves = [
        written(dataset[[name]].isel(time=part), tmp_path, f"{name}{number}.nc")
        for name in reversed(NAMES)
        for number, part in enumerate((slice(0, 3), slice(3, 7)))
    ]
    check(halves, file)


def test_files_of_other_grids_or_variables_are_refused(tmp_path: Path, whole: Any) -> None:
    dataset, file = whole
    first = written(dataset.isel(time=slice(0, 3)), tmp_path, "first.nc")
    moved = pair("current", NAMES, lattice(lats=LATS + 0.01)).isel(time=slice(3, 7))
    with pytest.raises(ValueError, match="first.nc and 1 more': files must have one grid"):
        check([first, written(moved, tmp_path, "moved.nc")], file)
    other = dataset.rename(uo="water_u", vo="water_v").isel(time=slice(3, 7))
    with pytest.raises(ValueError, match="files must have the same variables, got uo and vo; w"):
        check([first, written(other, tmp_path, "other.nc")], file)
    with pytest.raises(ValueError, match="current '.*none.nc' must be a NetCDF or GRIB file: No"):
        check([first, tmp_path / "none.nc"], file)


def test_a_scenario_names_a_list_or_a_pattern(tmp_path: Path, whole: Any) -> None:
    dataset, file = whole
    for hour in range(7):
        written(dataset.isel(time=[hour]), tmp_path, f"hour_{hour}.nc")
    fields = {
        "object": "PIW-1", "search_start": "2026-01-17T13:00Z",
        "seen": {"lat": -24.0, "lon": -46.0, "time": "2026-01-17T12:30Z"},
    }  # fmt: skip

    def of(name: Any) -> Incident:
        return Incident.read({**fields, "current": {"file": name}}, str(tmp_path))

    assert of("hour_*.nc") == of([f"hour_{hour}.nc" for hour in range(7)]) == of("whole.nc")
    assert not Incident.may_be_sent({**fields, "current": {"file": ["whole.nc"]}})
    with pytest.raises(FieldError, match="incident.current.file must match files, got 'day_"):
        of("day_*.nc")
    with pytest.raises(FieldError, match="incident.current.file must be 1 to 500 files, got 0"):
        of([])
    with pytest.raises(FieldError, match="incident.current.file must be a list of names, got 3"):
        of(3)
    assert np.isfinite(of("whole.nc").current.east_mps).all()


def test_a_scenario_states_for_how_long_one_time_counts(tmp_path: Path, whole: Any) -> None:
    dataset, _ = whole
    written(dataset.isel(time=[1]), tmp_path, "noon.nc")
    fields = {
        "object": "PIW-1", "search_start": "2026-01-17T13:00Z",
        "seen": {"lat": -24.0, "lon": -46.0, "time": "2026-01-17T12:30Z", "radius": 10},
    }  # fmt: skip

    def of(**current: Any) -> Incident:
        return Incident.read({**fields, "current": {"file": "noon.nc", **current}}, str(tmp_path))

    assert of(constant_hours=9).current.extent.end_s - START_S == 10 * 3600
    with pytest.raises(ValueError, match="or state constant_hours"):
        of()
    with pytest.raises(FieldError, match="current.constant_hours must be .*48 h, got 49"):
        of(constant_hours=49)
    with pytest.raises(FieldError, match="constant_hours"):
        Incident.read({**fields, "current": {"speed": 1, "toward": 0, "constant_hours": 3}})


def of_nemo(folder: Path, upper: tuple[float, float] = (0.5, 0.5)) -> list[str]:
    """Components on levels with names of their own, the upper one twice as fast."""
    files, dataset = [], pair("current", NAMES, units="m/s")
    for name, depth, first in zip(NAMES, ("depthu", "depthv"), upper, strict=True):
        layers = levels(dataset[[name]], depth, [first, 9.0], [2, 1], units="m", positive="down")
        files.append(str(written(layers, folder, f"{name}{first}.nc")))
    return files


def test_levels_of_components_may_have_names_of_their_own(tmp_path: Path, whole: Any) -> None:
    upper, lower = (
        read_forecast("current", of_nemo(tmp_path), SPAN, Choice(select=select))
        for select in ({}, {"depthu": 9.0, "depthv": 9.0})
    )
    for place in PLACES:
        wanted = np.array(by_xarray(whole[1], NAMES, place))
        assert by_flow(upper, place) == pytest.approx(2 * wanted, abs=1e-5)
        assert by_flow(lower, place) == pytest.approx(wanted, abs=1e-5)
    with pytest.raises(ValueError, match="must be at one level, got depthu 0.5, 9 m and depthv 1"):
        read_forecast("current", of_nemo(tmp_path, (0.5, 1.0)), SPAN)
    with pytest.raises(ValueError, match="uo and vo must be at one level"):
        read_forecast("current", of_nemo(tmp_path), SPAN, Choice(select={"depthu": 9.0}))
    with pytest.raises(ValueError, match="dimensions of uo and vo, time, depthu, .*depthw"):
        read_forecast("current", of_nemo(tmp_path), SPAN, Choice(select={"depthw": 9.0}))


def test_components_of_nemo_in_two_files_are_brought_to_one_place(tmp_path: Path) -> None:
    native = pytest.importorskip("native_forecasts")
    fields = native.staggered("nemo")
    files = []
    for side, name in (("u", "vozocrtx"), ("v", "vomecrty")):
        dataset = xarray.Dataset(
            {name: (("time_counter", "y", "x"), fields[side].astype(np.float32), {"units": "m/s"})},
            coords={
                "time_counter": ("time_counter", HOURS, {"units": f"hours since {START}"}),
                "nav_lat": (("y", "x"), fields[f"lat_{side}"], {"standard_name": "latitude"}),
                "nav_lon": (("y", "x"), fields[f"lon_{side}"], {"standard_name": "longitude"}),
            },
        )  # fmt: skip
        files.append(str(written(dataset, tmp_path, f"grid_{side}.nc")))
    south, west = native.BERGEN
    span = SPAN._replace(box=type(SPAN.box)(south - 0.05, south + 0.05, west - 0.1, west + 0.1))
    flow = read_forecast("current", files, span)
    for lat, lon in ((south, west), (south + 0.04, west - 0.08)):
        wanted = native.truth(lat, lon, 2.0)
        assert by_flow(flow, (lat, lon, 7200.0)) == pytest.approx(wanted, abs=2e-3)

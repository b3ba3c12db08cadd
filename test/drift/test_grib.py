# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""GRIB forecasts are read right, or refused in a line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drifting import little_memory
from forecasts import SPAN, by_flow

from dsse_ros.drift.flow_files import read_forecast
from dsse_ros.drift.shore import Box

eccodes = pytest.importorskip("eccodes")
pytest.importorskip("cfgrib")

LATS = np.linspace(-23.0, -25.0, 9)
LONS = np.linspace(313.0, 315.0, 9)
REGULAR = {
    "Ni": 9, "Nj": 9, "latitudeOfFirstGridPointInDegrees": -23.0,
    "latitudeOfLastGridPointInDegrees": -25.0, "longitudeOfFirstGridPointInDegrees": 313.0,
    "longitudeOfLastGridPointInDegrees": 315.0, "iDirectionIncrementInDegrees": 0.25,
    "jDirectionIncrementInDegrees": 0.25, "bitsPerValue": 24,
}  # fmt: skip
NOON = {"dataDate": 20260117, "dataTime": 1200}
AT_10_M = {
    1: {"indicatorOfTypeOfLevel": 105, "level": 10},
    2: {
        "typeOfFirstFixedSurface": 103, "scaleFactorOfFirstFixedSurface": 0,
        "scaledValueOfFirstFixedSurface": 10,
    },
}  # fmt: skip
PLACES = ((-24.1, -46.2, 1800.0), (-23.8, -45.8, 9000.0), (-24.25, -46.01, 17900.0))


def linear(lat: Any, lon: Any, hours: float) -> Any:
    """A wind to the east; interpolation is exact."""
    return 2.0 * (lat + 24) + 3.0 * (lon - 314) + 0.5 * hours


def add(file: Any, edition: int, values: Any, sample: str = "sfc", /, **keys: Any) -> None:
    message = eccodes.codes_grib_new_from_samples(f"regular_ll_{sample}_grib{edition}")
    for key, value in keys.items():
        eccodes.codes_set(message, key, value)
    eccodes.codes_set_values(message, np.asarray(values, np.float64).ravel())
    eccodes.codes_write(message, file)
    eccodes.codes_release(message)


def forecast(path: Path, edition: int = 2, *, steps: int = 6, high: bool = True,
             low: bool = True) -> Path:  # fmt: skip
    """Write a wind at 10 m between faster ones at 850 and 500 hPa."""
    with path.open("wb") as file:
        for step in range(steps):
            about = {**REGULAR, **NOON, "endStep": step}
            east = linear(LATS[:, None], LONS, step)
            for sign, side in ((1, "u"), (-1, "v")):
                if high:
                    add(file, edition, 0 * east + 60, "pl", **about, typeOfLevel="tropopause",
                        shortName=side)  # fmt: skip
                for level in (850, 500) if high else ():
                    add(file, edition, 0 * east + 40, "pl", **about, level=level, shortName=side)
                if low:
                    add(file, edition, sign * east, **about, **AT_10_M[edition],
                        shortName=f"10{side}")  # fmt: skip
    return path


@pytest.mark.slow
@pytest.mark.parametrize("edition", [1, 2])
def test_the_wind_at_10_m_is_found_among_others(tmp_path: Path, edition: int) -> None:
    flow = read_forecast("wind", forecast(tmp_path / "wind.grib", edition), SPAN)
    assert flow.source.endswith("u10 and v10")
    for place in PLACES:
        wanted = linear(place[0], place[1] + 360, place[2] / 3600)
        assert by_flow(flow, place) == pytest.approx((wanted, -wanted), abs=1e-4)
    # There is no index beside the forecast.
    assert [path.name for path in tmp_path.iterdir()] == ["wind.grib"]


@pytest.mark.slow
def test_files_of_one_step_each_are_a_series(tmp_path: Path) -> None:
    forecast_file = forecast(tmp_path / "whole.grib", high=False)
    data, parts = forecast_file.read_bytes(), []
    starts = [at for at in range(len(data)) if data[at : at + 4] == b"GRIB"] + [len(data)]
    for step in range(6):
        part = tmp_path / f"{step}.grib"
        part.write_bytes(data[starts[2 * step] : starts[2 * step + 2]])
        parts.append(part)
    assert read_forecast("wind", parts, SPAN) == read_forecast("wind", forecast_file, SPAN)


@pytest.mark.slow
@pytest.mark.parametrize("along_grid", [0, 1])
def test_winds_of_a_lambert_grid_are_turned_as_the_file_states(
    tmp_path: Path, along_grid: int
) -> None:
    native = pytest.importorskip("native_forecasts")
    mapping = {**native.LAMBERT, "earth_radius": 6371229.0}
    plane = native.Plane(mapping)
    south, west = 59.9, 3.8
    x0, y0 = plane.forward(south, west)
    x, y = np.meshgrid(x0 + 2500.0 * np.arange(30), y0 + 2500.0 * np.arange(30))
    lat, lon = plane.inverse(x, y)
    keys = {
        "gridType": "lambert", "Nx": 30, "Ny": 30, "latitudeOfFirstGridPointInDegrees": south,
        "longitudeOfFirstGridPointInDegrees": west, "LaDInDegrees": 63.0, "LoVInDegrees": 15.0,
        "Latin1InDegrees": 63.0, "Latin2InDegrees": 63.0, "DxInMetres": 2500.0,
        "DyInMetres": 2500.0, "jScansPositively": 1, "uvRelativeToGrid": along_grid,
        "shapeOfTheEarth": 6, "bitsPerValue": 24,
    }  # fmt: skip
    file = tmp_path / "arome.grib2"
    with file.open("wb") as made:
        for step in range(6):
            sides = native.truth(lat, lon, step)
            if along_grid:
                sides = native.along(*sides, plane.angle(lat, lon))
            for values, side in zip(sides, ("10u", "10v"), strict=True):
                add(made, 2, values, **keys, **NOON, endStep=step, **AT_10_M[2], shortName=side)
    place = (60.2, 4.5, 9000.0)
    flow = read_forecast("wind", file, SPAN._replace(box=Box(60.1, 60.3, 4.3, 4.7)))
    assert by_flow(flow, place) == pytest.approx(native.truth(60.2, 4.5, 2.5), abs=2e-3)


@pytest.mark.slow
def test_a_forecast_without_the_wind_at_10_m_is_refused_in_a_line(tmp_path: Path) -> None:
    file = forecast(tmp_path / "wind.grib", low=False)
    with pytest.raises(ValueError) as error:
        read_forecast("wind", file, SPAN)
    assert "wind must be at 10 m above ground, got u and v at isobaricInhPa 850, 500 hPa" in str(
        error.value
    )
    with pytest.raises(ValueError, match="file must have a pair of variables such as surface_east"):
        read_forecast("current", forecast(tmp_path / "low.grib", high=False), SPAN)


def cut(path: Path) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2 + 50])


def of_giant_field(path: Path) -> None:
    """A field of one value for 900 million points takes 200 bytes."""
    with path.open("wb") as file:
        message = eccodes.codes_grib_new_from_samples("regular_ll_sfc_grib2")
        eccodes.codes_set(message, "Ni", 30_000)
        eccodes.codes_set(message, "Nj", 30_000)
        eccodes.codes_set(message, "numberOfDataPoints", 900_000_000)
        eccodes.codes_write(message, file)
        eccodes.codes_release(message)


HOSTILE: dict[str, tuple[Any, str]] = {
    "cut off": (cut, "file must be GRIB: "),
    "a giant field": (of_giant_field, "a field must have at most 20000000 values, got 900000000"),
    "nothing but the magic": (lambda path: path.write_bytes(b"GRIB"), "file must"),
    "noise": (lambda path: path.write_bytes(b"GRIB" + bytes(range(256)) * 9), "file must"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_broken_file_is_refused_in_a_line(tmp_path: Path, name: str) -> None:
    spoil, message = HOSTILE[name]
    file = forecast(tmp_path / "wind.grib", steps=2)
    spoil(file)
    with little_memory(), pytest.raises(ValueError) as error:
        read_forecast("wind", file, SPAN)
    assert message in str(error.value) and "wind.grib" in str(error.value)
    assert "\n" not in str(error.value)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""GRIB forecasts are read right, or refused in a line."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drifting import little_memory
from forecasts import SPAN, by_flow

from dsse_ros.world.drift.flow_files import read_forecast
from dsse_ros.world.drift.shore import Box
from dsse_ros.world.drift.velocity_pairs import Choice

eccodes = pytest.importorskip("eccodes")

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


def series(path: Path, fields: Any, sample: str = "sfc", edition: int = 2, **keys: Any) -> Path:
    """Write a wind at 10 m for six hours; `fields(hours)` are its values in their order."""
    with path.open("wb") as file:
        for step in range(6):
            for sign, side in ((1, "10u"), (-1, "10v")):
                about = {**NOON, "bitsPerValue": 24, **AT_10_M[edition], **keys, "endStep": step}
                add(file, edition, sign * fields(step), sample, **about, shortName=side)
    return path


def scanned(values: Any, flips: int, by_columns: int, alternates: int) -> Any:
    """Values of rows from the north and columns from the west, in the order of a message."""
    lines = values[:, ::-1] if flips else values
    lines = (lines.T if by_columns else lines).copy()
    if alternates:
        lines[1::2] = lines[1::2, ::-1]
    return lines


SCANS = [*product((0, 1), repeat=4)]


def flags(scan: tuple[int, int, int, int]) -> dict[str, Any]:
    names = (
        "iScansNegatively", "jScansPositively", "jPointsAreConsecutive", "alternativeRowScanning",
    )  # fmt: skip
    return dict(zip(names, scan, strict=True))


@pytest.mark.parametrize("scan", SCANS)
def test_a_message_is_read_at_its_places_in_whatever_order_it_has_them(
    tmp_path: Path, scan: tuple[int, int, int, int]
) -> None:
    flips, from_south, by_columns, alternates = scan
    lats = LATS[::-1] if from_south else LATS
    ends = {
        "latitudeOfFirstGridPointInDegrees": lats[0], "latitudeOfLastGridPointInDegrees": lats[-1],
        "longitudeOfFirstGridPointInDegrees": LONS[-1 if flips else 0],
        "longitudeOfLastGridPointInDegrees": LONS[0 if flips else -1],
    }  # fmt: skip

    def fields(hours: int) -> Any:
        return scanned(linear(lats[:, None], LONS, hours), flips, by_columns, alternates)

    file = series(tmp_path / "wind.grib", fields, **{**REGULAR, **ends}, **flags(scan))
    flow = read_forecast("wind", file, SPAN)
    for place in PLACES:
        wanted = linear(place[0], place[1] + 360, place[2] / 3600)
        assert by_flow(flow, place) == pytest.approx((wanted, -wanted), abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("last", [-1.875, 358.125])
@pytest.mark.parametrize("edition", [1, 2])
def test_a_globe_is_read_at_its_places_whatever_its_last_longitude_is_called(
    tmp_path: Path, last: float, edition: int
) -> None:
    if edition == 2 and last < 0:
        pytest.skip("GRIB 2 has longitudes from 0")
    lats, lons = np.linspace(90, -90, 97), np.arange(192) * 1.875
    keys = {
        "Ni": 192, "Nj": 97, "latitudeOfFirstGridPointInDegrees": 90.0,
        "latitudeOfLastGridPointInDegrees": -90.0, "longitudeOfFirstGridPointInDegrees": 0.0,
        "longitudeOfLastGridPointInDegrees": last, "iDirectionIncrementInDegrees": 1.875,
        "jDirectionIncrementInDegrees": 1.875,
    }  # fmt: skip

    def fields(hours: int) -> Any:
        return 10 * np.cos(np.radians(lons)) + 0 * lats[:, None]

    file = series(tmp_path / "flux.grb", fields, edition=edition, **keys)
    for lon in (-178.125, -46.875, -1.875, 0.0, 45.0):
        box = Box(-24.25, -23.75, lon - 0.25, lon + 0.25)
        flow = read_forecast("wind", file, SPAN._replace(box=box))
        wanted = 10 * np.cos(np.radians(lon))
        assert by_flow(flow, (-24.0, lon, 7200.0)) == pytest.approx((wanted, -wanted), abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scan", "along_grid"),
    [(scan, along) for scan in SCANS for along in (0, 1) if along or scan == (0, 1, 0, 0)],
)
def test_winds_of_a_lambert_grid_are_turned_as_the_file_states_or_refused(
    tmp_path: Path, scan: tuple[int, int, int, int], along_grid: int
) -> None:
    native = pytest.importorskip("native_forecasts")
    flips, from_south, by_columns, alternates = scan
    plane = native.Plane({**native.LAMBERT, "earth_radius": 6371229.0})
    x0, y0 = plane.forward(59.9, 3.8)
    x, y = np.meshgrid(x0 + 2500.0 * np.arange(30), y0 + 2500.0 * np.arange(30))
    x, y = (values if from_south else values[::-1] for values in (x, y))
    lat, lon = plane.inverse(x, y)
    first = (0, -1 if flips else 0)
    keys = {
        "gridType": "lambert", "Nx": 30, "Ny": 30, "latitudeOfFirstGridPointInDegrees": lat[first],
        "longitudeOfFirstGridPointInDegrees": lon[first], "LaDInDegrees": 63.0,
        "LoVInDegrees": 15.0, "Latin1InDegrees": 63.0, "Latin2InDegrees": 63.0,
        "DxInMetres": 2500.0, "DyInMetres": 2500.0, "uvRelativeToGrid": along_grid,
        "shapeOfTheEarth": 6, "bitsPerValue": 24, **flags(scan),
    }  # fmt: skip
    file = tmp_path / "arome.grib2"
    with file.open("wb") as made:
        for step in range(6):
            sides = native.truth(lat, lon, step)
            if along_grid:
                sides = native.along(*sides, plane.angle(lat, lon))
            for values, side in zip(sides, ("10u", "10v"), strict=True):
                in_order = scanned(values, flips, by_columns, alternates)
                about = {**NOON, **AT_10_M[2], "endStep": step, "shortName": side}
                add(made, 2, in_order, **keys, **about)
    place = (60.2, 4.5, 9000.0)
    span = SPAN._replace(box=Box(60.1, 60.3, 4.3, 4.7))
    if (flips, from_south) != (0, 1) or by_columns and alternates:
        # ecCodes 2.42 has wrong places for these.
        with pytest.raises(ValueError, match="grid lambert must have its rows from the south and"):
            read_forecast("wind", file, span)
        return
    flow = read_forecast("wind", file, span)
    assert by_flow(flow, place) == pytest.approx(native.truth(60.2, 4.5, 2.5), abs=2e-3)


@pytest.mark.slow
def test_only_the_messages_of_the_pair_and_the_times_needed_are_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "wind.grib"
    about = {**REGULAR, **NOON}
    with file.open("wb") as made:
        east = linear(LATS[:, None], LONS, 0.0)
        for step in range(6):
            for side in "uv":
                for level in range(100, 1000, 50):
                    add(made, 2, east, "pl", **about, endStep=step, level=level, shortName=side)
                keys = {**about, **AT_10_M[2], "endStep": step, "shortName": f"10{side}"}
                add(made, 2, east, **keys)
    unpacked = []
    values_of = eccodes.codes_get_values
    monkeypatch.setattr(
        eccodes, "codes_get_values", lambda message: unpacked.append(1) or values_of(message)
    )
    span = SPAN._replace(end_s=SPAN.begin_s + 3600)
    assert len(read_forecast("wind", file, span).times_s) == 3
    assert len(unpacked) == 2 * 3


def two_runs(path: Path) -> Path:
    """Runs of 12 and 14 o'clock; the later one is faster by 10 m/s."""
    with path.open("wb") as file:
        for time, later in ((1400, 10.0), (1200, 0.0)):
            for step in range(5):
                hours = step + time / 100 - 12
                for sign, side in ((1, "10u"), (-1, "10v")):
                    east = linear(LATS[:, None], LONS, hours) + later
                    about = {**REGULAR, **NOON, "dataTime": time, "endStep": step, **AT_10_M[2]}
                    add(file, 2, sign * east, **about, shortName=side)
    return path


@pytest.mark.slow
def test_of_two_runs_the_last_one_that_has_a_time_counts_or_the_one_that_is_chosen(
    tmp_path: Path,
) -> None:
    file = two_runs(tmp_path / "gfs.grib2")
    early, late = (-24.0, -46.0, 3600.0), (-24.0, -46.0, 3 * 3600.0)
    flow = read_forecast("wind", file, SPAN)
    assert by_flow(flow, early) == pytest.approx((0.5, -0.5), abs=1e-4)
    assert by_flow(flow, late) == pytest.approx((11.5, -11.5), abs=1e-4)
    noon = read_forecast("wind", file, SPAN, Choice(select={"run": "2026-01-17T12:00Z"}))
    assert by_flow(noon, late) == pytest.approx((1.5, -1.5), abs=1e-4)
    with pytest.raises(ValueError, match="of run, 2026-01-17T12:00:00Z, 2026-01-17T14:00:00Z, got"):
        read_forecast("wind", file, SPAN, Choice(select={"run": "2026-01-17T13:00Z"}))


@pytest.mark.slow
def test_both_components_in_one_message_are_read(tmp_path: Path) -> None:
    file, joined = forecast(tmp_path / "wind.grib2", high=False), tmp_path / "gfs.grib2"
    ends, data = [], file.read_bytes()
    with file.open("rb") as source:
        while (message := eccodes.codes_grib_new_from_file(source)) is not None:
            ends.append(message)
        eccodes.codes_grib_multi_support_on()
        with joined.open("wb") as made:
            for east, north in zip(ends[::2], ends[1::2], strict=True):
                several = eccodes.codes_grib_multi_new()
                for message in (east, north):
                    eccodes.codes_grib_multi_append(message, 4, several)
                eccodes.codes_grib_multi_write(several, made)
                eccodes.codes_grib_multi_release(several)
        eccodes.codes_grib_multi_support_off()
    assert joined.read_bytes().count(b"7777") == data.count(b"7777") / 2
    assert read_forecast("wind", joined, SPAN) == read_forecast("wind", file, SPAN)


@pytest.mark.slow
def test_the_spread_of_an_ensemble_is_no_wind(tmp_path: Path) -> None:
    def fields(hours: int) -> Any:
        return linear(LATS[:, None], LONS, hours)

    derived = {**REGULAR, "productDefinitionTemplateNumber": 2, "derivedForecast": 4}
    spread = series(tmp_path / "spread.grib2", lambda hours: 9 + 0 * fields(hours), **derived)
    with pytest.raises(ValueError, match="file must have velocities, got 10u, 10v"):
        read_forecast("wind", spread, SPAN)
    mean = series(tmp_path / "mean.grib2", fields, **{**derived, "derivedForecast": 0})
    both = tmp_path / "both.grib2"
    both.write_bytes(mean.read_bytes() + spread.read_bytes())
    assert read_forecast("wind", both, SPAN) == read_forecast("wind", mean, SPAN)


@pytest.mark.slow
def test_a_forecast_without_the_wind_at_10_m_is_refused_in_a_line(tmp_path: Path) -> None:
    file = forecast(tmp_path / "wind.grib", low=False)
    with pytest.raises(ValueError) as error:
        read_forecast("wind", file, SPAN)
    message = str(error.value)
    assert "wind must be at 10 m above ground, got u and v at tropopause; " in message
    assert "u and v at isobaricInhPa 500, 850 hPa; choose" in message
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
    "noise": (lambda path: path.write_bytes(b"GRIB" + bytes(range(256)) * 9), "must be a NetCDF"),
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

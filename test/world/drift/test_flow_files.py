# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Wind and current from NetCDF files: read right, or refused in one line."""

from __future__ import annotations

import json
import math
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drifting import drift_of, little_memory
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.world.drift.flow import Extent, Flow, Span, Uncertainty, seconds
from dsse_ros.world.drift.flow_files import read_forecast
from dsse_ros.world.drift.shore import Box
from dsse_ros.world.drift.sightings import Sighting
from dsse_ros.world.drift.tracks import drift_tracks
from dsse_ros.world.scenario.incident import Incident
from dsse_ros.world.scenario.incident_flow import flow_dict

pytest.importorskip("xarray")
netcdf = pytest.importorskip("netCDF4")

START_S = seconds("2026-01-17T12:00Z")
SPAN = Span(Box(-24.25, -23.75, -46.25, -45.75), START_S + 1800, START_S + 5400)
TIMES = np.arange(4.0)
LATS = np.linspace(-25.0, -23.0, 9)
LONS = np.linspace(-47.0, -45.0, 9)


def of_place(lat: np.ndarray, lon: np.ndarray, hour: np.ndarray) -> np.ndarray:
    """Velocity to the east: linear, so that interpolation is exact."""
    return 0.1 * (lat + 24) + 0.02 * (lon + 46) + 0.3 * hour


def write(path: Path, *, lats: Any = LATS, lons: Any = LONS, times: Any = TIMES,
          units: str = "hours since 2026-01-17 12:00", speed: str = "m s-1", depths: int = 0,
          standard: bool = True, north: bool = True, fill: float | None = None, hole: Any = None,
          hours: Any = TIMES, calendar: str | None = None) -> Path:  # fmt: skip
    """Write a file of a current."""
    with netcdf.Dataset(path, "w") as file:
        dims = []
        if times is not None:
            file.createDimension("time", None)
            time = file.createVariable("time", "f8", ("time",))
            time[:], time.units, time.standard_name = times, units, "time"
            dims.append("time")
            if calendar is not None:
                time.calendar = calendar
        if depths:
            file.createDimension("depth", depths)
            depth = file.createVariable("depth", "f4", ("depth",))
            depth[:], depth.standard_name = np.arange(depths, 0, -1) * 10.0, "depth"
            dims.append("depth")
        for name, values in (("lat", lats), ("lon", lons)):
            file.createDimension(name, len(values))
            axis = file.createVariable(name, "f8", (name,))
            axis[:], axis.units = values, "degrees"
            dims.append(name)
        hour = np.asarray(hours)[:, None, None] if times is not None else np.zeros((1, 1, 1))
        place = (np.asarray(lons, float) + 180) % 360 - 180
        field = of_place(np.asarray(lats, float)[None, :, None], place[None, None, :], hour)
        for name, factor in (("uo", 1.0), ("vo", -1.0)):
            if name == "vo" and not north:
                continue
            variable = file.createVariable(name, "f4", dims, fill_value=fill)
            variable.units = speed
            if standard:
                word = "eastward" if name == "uo" else "northward"
                variable.standard_name = f"{word}_sea_water_velocity"
            values = factor * field
            if hole is not None:
                values[hole] = fill if fill is not None else np.nan
            values = values if times is not None else values[0]
            if depths:
                # The level nearest to the surface is the last one.
                levels = [values + 50.0] * (depths - 1) + [values]
                values = np.stack(levels, axis=1 if times is not None else 0)
            variable[:] = values
    return path


def value(flow: Flow, lat: float, lon: float, time_s: float) -> tuple[float, float]:
    """Interpolate with NumPy alone."""
    found = []
    for array in (flow.east_mps, flow.north_mps):
        east = np.array([[np.interp(lon, flow.lons_deg, row) for row in level] for level in array])
        column = np.array([np.interp(lat, flow.lats_deg, level) for level in east])
        found.append(float(np.interp(time_s, flow.times_s, column)))
    return found[0], found[1]


def check(flow: Flow) -> None:
    for lat, lon, after_s in ((-24.1, -46.2, 1800), (-23.8, -45.8, 3000), (-24.25, -46.0, 5400)):
        wanted = of_place(lat, lon, after_s / 3600)
        east, north = value(flow, lat, lon, START_S + after_s)
        assert east == pytest.approx(wanted, abs=1e-5)
        assert north == pytest.approx(-wanted, abs=1e-5)


SINCE_1900 = (START_S - seconds("1900-01-01T00:00")) / 3600
RIGHT: dict[str, dict[str, Any]] = {
    "plain": {},
    "descending latitudes": {"lats": LATS[::-1]},
    "longitudes from 0": {"lons": LONS + 360},
    "longitudes around the globe from 0": {"lons": np.arange(0.0, 360.0, 0.5)},
    "the first meridian twice": {"lons": np.arange(0.0, 361.0, 0.5)},
    "the antimeridian twice": {"lons": np.arange(-180.0, 180.5, 0.5)},
    "a calendar in another case": {"calendar": "Gregorian"},
    "a calendar with its words exchanged": {"calendar": "gregorian_proleptic"},
    "a calendar of before 1582": {
        "calendar": "proleptic_gregorian",
        "units": "hours since 0001-01-01",
        "times": TIMES + (START_S + 719162 * 86400.0) / 3600,
    },
    "hours since 1900": {"times": TIMES + SINCE_1900, "units": "hours since 1900-01-01"},
    "seconds since 1970": {"times": TIMES * 3600 + START_S, "units": "seconds since 1970-01-01"},
    "depths, the deepest first": {"depths": 3},
    "one depth": {"depths": 1},
    "names alone": {"standard": False},
    "another spelling of the units": {"speed": "m/s"},
    "a fill value far from the span": {"fill": 9.96921e36, "hole": np.s_[:, 0, 0]},
    "times out of order": {"times": TIMES[::-1], "hours": TIMES[::-1]},
}


@pytest.mark.parametrize("name", RIGHT)
def test_a_file_is_read_right(tmp_path: Path, name: str) -> None:
    check(read_forecast("current", write(tmp_path / "sea.nc", **RIGHT[name]), SPAN))


def test_an_area_across_the_seam_of_the_file_is_read_right(tmp_path: Path) -> None:
    file = write(tmp_path / "sea.nc", lons=np.arange(0.0, 360.0, 0.5))
    span = SPAN._replace(box=Box(-24.25, -23.75, -1.2, 1.2))
    flow = read_forecast("current", file, span)
    for lon in (-1.0, -0.1, 0.4):
        wanted = of_place(-24.0, lon, 0.5)
        assert value(flow, -24.0, lon, START_S + 1800)[0] == pytest.approx(wanted, abs=1e-4)


@given(fill=st.floats(13.0, 1e6), sign=st.sampled_from((-1, 1)))
@settings(deadline=None, max_examples=10)
def test_a_fill_value_that_no_attribute_declares_is_no_current(fill: float, sign: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = write(Path(folder) / "sea.nc")
        with netcdf.Dataset(file, "a") as made:
            for name in ("uo", "vo"):
                made[name][:, 4, 4] = sign * fill
        flow = read_forecast("current", file, SPAN, gap_cells=0)
    gap = np.isnan(flow.east_mps)
    assert gap.sum() == len(flow.times_s)
    assert gap[0, flow.lats_deg == -24.0, flow.lons_deg == -46.0].all()


def test_a_current_has_a_limit_of_its_own_at_every_door(tmp_path: Path) -> None:
    about = {
        "object": "PIW-1", "search_start": "2026-01-17T13:00Z",
        "seen": {"lat": -24.0, "lon": -46.0, "time": "2026-01-17T12:30Z"},
    }  # fmt: skip
    assert Incident.read({**about, "wind": {"speed": 50, "from": 0}}).wind
    with pytest.raises(ValueError, match="current.speed must be .*12"):
        Incident.read({**about, "current": {"speed": 50, "toward": 0}})
    table = tmp_path / "sea.csv"
    table.write_text("time,speed_mps,toward\n2026-01-17T12:00Z,50,0\n2026-01-17T19:00Z,1,0\n")
    with pytest.raises(ValueError, match="a speed from 0 to 12 m/s"):
        Incident.read({**about, "current": {"file": str(table)}})
    fast = Incident.read({**about, "wind": {"speed": 50, "from": 0}})
    with pytest.raises(ValueError, match="current must have increasing axes and a velocity"):
        Incident.read({**about, "current": flow_dict(fast.wind, Uncertainty())})


@pytest.mark.parametrize("fill", [None, -32767.0, 1e20])
def test_a_gap_stays_a_gap(tmp_path: Path, fill: float | None) -> None:
    file = write(tmp_path / "sea.nc", fill=fill, hole=np.s_[:, 4, 4])
    flow = read_forecast("current", file, SPAN, gap_cells=0)
    gap = np.isnan(flow.east_mps)
    assert gap.sum() == len(flow.times_s)
    assert gap[0, flow.lats_deg == -24.0, flow.lons_deg == -46.0].all()


def test_only_what_is_needed_is_read(tmp_path: Path) -> None:
    file = write(tmp_path / "sea.nc")
    assert read_forecast("current", file, SPAN, gap_cells=0).east_mps.shape == (3, 3, 3)
    assert read_forecast("current", file, SPAN, gap_cells=1).east_mps.shape == (3, 5, 5)


def test_a_file_of_less_than_the_span_serves_where_it_reaches(tmp_path: Path) -> None:
    file = write(tmp_path / "harbour.nc", lats=LATS[4:], times=TIMES[:2], hours=TIMES[:2])
    flow = read_forecast("current", file, SPAN)
    assert flow.lats_deg[0] == -24.0 and flow.times_s[-1] == START_S + 3600
    times = np.array([START_S + 1800, START_S + 3600.0])
    seen = Sighting(-23.9, -46.0, times[0])
    moved = drift_tracks(drift_of(current=flow), [seen], times, 1, np.random.default_rng(1))
    assert moved.lats_deg[-1] != moved.lats_deg[0]
    message = (
        "current .*harbour.nc: uo and vo' has no value at -2.* it covers 2026-01-17T12:00:00Z to"
    )
    for late, lat in ((3600.0, -23.9), (0.0, -24.1)):
        away = seen._replace(lat_deg=lat)
        with pytest.raises(ValueError, match=message):
            drift_tracks(drift_of(current=flow), [away], times + late, 1, np.random.default_rng(1))


def sparse(path: Path, *, lats: int = 4500, chunk: int = 100) -> Path:
    """Write a file of 3 GB, of which only the values around the span are on the disk."""
    with netcdf.Dataset(path, "w") as file:
        for name, size, low, high in (
            ("time", 20, 0, 19), ("lat", lats, -30, -20), ("lon", 4500, -50, -40),
        ):  # fmt: skip
            file.createDimension(name, size)
            axis = file.createVariable(name, "f8", (name,))
            if size <= 4500:
                axis[:] = np.linspace(low, high, size)
        file["time"].units = "hours since 2026-01-17 12:00"
        for name in ("uo", "vo"):
            chunks = (1, min(chunk, lats), chunk)
            speed = file.createVariable(
                name, "f4", ("time", "lat", "lon"), chunksizes=chunks, zlib=True
            )
            speed.units = "m s-1"
            if chunk == 100 and lats == 4500:
                speed[0:3, 2500:2900, 1600:2000] = 0.25
    return path


def test_of_a_large_file_only_what_is_needed_takes_memory(tmp_path: Path) -> None:
    read_forecast("current", write(tmp_path / "first.nc"), SPAN)
    file = sparse(tmp_path / "sea.nc")
    with little_memory():
        flow = read_forecast("current", file, SPAN)
    assert flow.east_mps.shape == (3, 231, 231)
    assert (flow.east_mps == 0.25).all()


@pytest.mark.parametrize(
    ("options", "width_deg", "message"),
    [
        ({}, 4.0, "must have at most 20000000 values in the area and the times needed, got 20 x"),
        ({"lats": 400_000_000}, 0.25, "axis of lat must have at most 20000000 values, got 4000000"),
        ({"chunk": 4500}, 0.25, "chunk of uo must have at most 20000000 values, got 20250000"),
    ],
)
def test_a_file_that_would_fill_the_memory_is_refused_in_a_line(
    tmp_path: Path, options: dict[str, int], width_deg: float, message: str
) -> None:
    read_forecast("current", write(tmp_path / "first.nc"), SPAN)
    file = sparse(tmp_path / "sea.nc", **options)
    box = Box(-24 - width_deg, -24 + width_deg, -46 - width_deg, -46 + width_deg)
    span = Span(box, START_S, START_S + 19 * 3600) if width_deg > 1 else SPAN
    with little_memory(), pytest.raises(ValueError) as error:
        read_forecast("current", file, span)
    assert message in str(error.value) and "sea.nc" in str(error.value)
    assert "\n" not in str(error.value)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "no variable": ({"north": False}, "got uo (eastward_sea_water_velocity); choose"),
    "no units": ({"speed": ""}, "uo has no units; state units, such as m/s"),
    "too late": (
        {"times": TIMES + 24},
        "must cover time within 2026-01-17T12:30:00Z to 2026-01-17T13:30:00Z, got 2026-01-18",
    ),
    "another calendar": ({"calendar": "noleap"}, "time must have the standard calendar, got 'nole"),
    "elsewhere": ({"lats": LATS + 10}, "must cover latitude within -24.2500 to -23.7500, got -15."),
    "another sea": ({"lons": LONS + 90}, "must cover longitude"),
    "strange times": ({"units": "fortnights"}, "units like 'hours since"),
    "nothing but gaps": ({"fill": 1e20, "hole": np.s_[:]}, "no value of at most 12 m/s in"),
    "a time twice": ({"times": np.array([0.0, 1.0, 1.0, 2.0])}, "time must have each value once"),
    "a gap in an axis": (
        {"lats": np.where(LATS == -24.0, np.nan, LATS)}, "lat must have values without gaps",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_that_does_not_fit_is_refused_in_a_line(tmp_path: Path, name: str) -> None:
    options, message = REFUSED[name]
    with pytest.raises(ValueError) as error:
        read_forecast("current", write(tmp_path / "sea.nc", **options), SPAN)
    assert message in str(error.value) and "sea.nc" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("lons", [np.arange(-180.0, 180.1), np.arange(0.0, 360.1)])
def test_a_file_with_a_meridian_twice_is_read_everywhere(tmp_path: Path, lons: Any) -> None:
    file = write(tmp_path / "sea.nc", lons=lons)
    for centre in np.random.default_rng(0).uniform(-180, 180, 30).round(3):
        span = SPAN._replace(box=Box(-24.25, -23.75, centre - 0.5, centre + 0.5))
        flow = read_forecast("current", file, span)
        assert flow.lons_deg[0] <= centre - 0.5 and flow.lons_deg[-1] >= centre + 0.5


def coast(folder: Path) -> Path:
    """A current whose model ends two cells before the place of `SPAN` in the east."""
    return write(folder / "coast.nc", fill=1e20, hole=np.s_[:, :, 4:])


def test_a_gap_at_the_coast_takes_the_nearest_value(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    flow = read_forecast("current", coast(tmp_path), SPAN)
    assert "54 of 54 cells" not in caplog.text and "at most 2 cells away" in caplog.text
    # The last longitude with values is 46.25 W, and two cells of 0.25 degrees count.
    hour = (flow.times_s[0] - START_S) / 3600
    for lon in (-46.0, -45.75):
        value = flow.east_mps[0, flow.lats_deg == -24.0, flow.lons_deg == lon]
        assert value == pytest.approx(of_place(-24.0, -46.25, hour), abs=1e-6)
    assert np.isnan(flow.east_mps[0, flow.lats_deg == -24.0, flow.lons_deg == -45.5]).all()


def test_a_drift_into_a_gap_or_out_of_the_part_that_was_read_is_refused_as_such(
    tmp_path: Path,
) -> None:
    def refusal(flow: Flow, lon: float) -> str:
        times = START_S + np.array([1800.0, 5400.0])
        seen = Sighting(-24.0, lon, times[0])
        with pytest.raises(ValueError) as error:
            drift_tracks(drift_of(current=flow), [seen], times, 1, np.random.default_rng(1))
        return str(error.value)

    flow = read_forecast("current", coast(tmp_path), SPAN, gap_cells=1)
    assert "has a gap there, with no value within 1 cells; give a shore" in refusal(flow, -45.6)
    whole = read_forecast("current", write(tmp_path / "sea.nc"), SPAN)
    covered = "the file covers 2026-01-17T12:00:00Z to 2026-01-17T15:00:00Z, 25.0000 S to 23.0000 S"
    assert covered in refusal(whole, -45.1)
    assert "it covers 2026-01-17T12:00:00Z to" in refusal(whole, -44.0)


@pytest.mark.parametrize("content", [b"", b"CDF\x01", b"hello", b"\x89HDF\r\n\x1a\n" + bytes(99)])
def test_a_file_of_another_kind_is_refused_in_a_line(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "sea.nc"
    file.write_bytes(content)
    with pytest.raises(ValueError, match="current .*sea.nc'"):
        read_forecast("current", file, SPAN)


def test_a_grid_without_places_is_refused_in_a_line(tmp_path: Path) -> None:
    file = tmp_path / "sea.nc"
    with netcdf.Dataset(file, "w") as made:
        for name in ("y", "x"):
            made.createDimension(name, 3)
        for name in ("u", "v"):
            made.createVariable(name, "f4", ("y", "x")).units = "m s-1"
    with pytest.raises(ValueError, match="u must have latitudes and longitudes, or the coord"):
        read_forecast("current", file, SPAN)


def test_a_missing_library_is_refused_with_the_command_that_installs_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file = write(tmp_path / "sea.nc")
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(
        ValueError, match=r"sea.nc': xarray is missing; .* -m pip install '.*\[drift\]'"
    ):
        read_forecast("current", file, SPAN)


def test_a_flow_without_ends_is_the_same_after_json() -> None:
    about = {
        "object": "PIW-1", "search_start": "2026-01-17T13:00Z",
        "seen": {"lat": -24.0, "lon": -46.0, "time": "2026-01-17T12:30Z"},
    }  # fmt: skip
    flow = Incident.read({**about, "wind": {"speed": 5, "from": 90}}).wind
    endless = replace(flow, extent=Extent(0.0, 3600.0, -math.inf, math.inf, -24.0, math.inf))
    text = json.dumps(flow_dict(endless, Uncertainty()), allow_nan=False)
    again = Incident.read({**about, "wind": json.loads(text)}).wind
    assert again == endless and again.extent == endless.extent

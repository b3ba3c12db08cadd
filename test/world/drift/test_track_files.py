# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tracks of OpenDrift's NetCDF files."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drifting import little_memory

from dsse_ros.world.drift.flow import seconds
from dsse_ros.world.drift.track_files import at_times, read_tracks

pytest.importorskip("xarray")
netcdf = pytest.importorskip("netCDF4")

START_S = seconds("2026-01-17T12:00Z")
NAN = np.nan
LATS = np.array([[-24.0, -24.1, -24.2], [-24.0, -24.3, NAN], [NAN, -24.4, -24.5], [NAN, NAN, NAN]])
LONS = np.where(np.isfinite(LATS), LATS - 22.0, NAN)
"""Particles by time: one active, one deactivated, one released late, one never."""


def write(path: Path, *, dims: tuple[str, ...] = ("trajectory", "time"), lats: Any = LATS,
          fill: float = 9.96921e36, units: str = "seconds since 1970-01-01 00:00:00",
          names: tuple[str, str] = ("lat", "lon"), since_s: float = 0.0,
          calendar: str = "standard") -> Path:  # fmt: skip
    with netcdf.Dataset(path, "w") as file:
        file.createDimension("trajectory", len(lats))
        file.createDimension("time", lats.shape[1])
        time = file.createVariable("time", "f8", ("time",))
        time[:] = START_S - since_s + 600.0 * np.arange(lats.shape[1])
        time.units, time.calendar = units, calendar
        for name, values in zip(names, (lats, lats - 22.0), strict=True):
            variable = file.createVariable(name, "f4", dims, fill_value=fill)
            values = np.where(np.isfinite(values), values, fill)
            variable[:] = values if dims[0] == "trajectory" else values.T
    return path


@pytest.mark.parametrize("dims", [("trajectory", "time"), ("time", "trajectory")])
def test_each_particle_is_where_its_file_has_it(tmp_path: Path, dims: tuple[str, ...]) -> None:
    tracks = read_tracks(write(tmp_path / "drift.nc", dims=dims))
    assert tracks.times_s.tolist() == [START_S, START_S + 600, START_S + 1200]
    wanted = np.array([[-24.0, -24.0, -24.4], [-24.1, -24.3, -24.4], [-24.2, -24.3, -24.5]])
    assert tracks.lats_deg == pytest.approx(wanted, abs=1e-5)
    assert tracks.lons_deg == pytest.approx(wanted - 22, abs=1e-5)
    assert tracks.stranded.tolist() == [[False] * 3, [False] * 3, [False, True, False]]


def test_a_calendar_is_that_of_the_file(tmp_path: Path) -> None:
    # Days of the proleptic Gregorian calendar from the first of year 1, as `datetime` has them.
    since_s = -(datetime(1970, 1, 1) - datetime(1, 1, 1)).total_seconds()
    units = "seconds since 0001-01-01 00:00:00"
    file = write(
        tmp_path / "drift.nc", units=units, since_s=since_s, calendar="proleptic_gregorian"
    )
    assert read_tracks(file).times_s[0] == START_S


def test_tracks_are_linear_between_their_times(tmp_path: Path) -> None:
    tracks = read_tracks(write(tmp_path / "drift.nc"))
    between = at_times(tracks, np.array([START_S + 300.0, START_S + 1200.0]))
    assert between.lats_deg[:, 0] == pytest.approx([-24.05, -24.2], abs=1e-5)
    with pytest.raises(ValueError, match="the tracks must cover .*12:20:01Z, got .*12:20:00Z"):
        at_times(tracks, np.array([START_S, START_S + 1201.0]))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"names": ("latitude", "lon")}, "must have a variable lat, got"),
        ({"dims": ("trajectory",)}, "lat must be along time and trajectory, got trajectory"),
        ({"lats": np.full((2, 3), NAN)}, "must have positions"),
        ({"units": "moons"}, "must have units like 'hours since 1900-01-01', got 'moons'"),
    ],
)
def test_another_file_is_refused_in_a_line(
    tmp_path: Path, options: dict[str, Any], message: str
) -> None:
    if options.get("dims") == ("trajectory",):
        options = {**options, "lats": np.full((3, 1), -24.0)}
        with netcdf.Dataset(tmp_path / "drift.nc", "w") as file:
            file.createDimension("trajectory", 3)
            for name in ("time", "lat", "lon"):
                file.createVariable(name, "f8", ("trajectory",))
    else:
        write(tmp_path / "drift.nc", **options)
    with pytest.raises(ValueError) as error:
        read_tracks(tmp_path / "drift.nc")
    assert message in str(error.value) and "\n" not in str(error.value)


def test_a_file_of_another_kind_is_refused_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "drift.nc").write_text("time,lat,lon\n")
    with pytest.raises(ValueError, match="drift.nc' must be a NetCDF file of OpenDrift"):
        read_tracks(tmp_path / "drift.nc")


@pytest.mark.parametrize(
    ("particles", "times", "message"),
    [
        (4_000_000, 200, "at most 20000000 positions, got 800000000"),
        (1, 400_000_000, "axis of time must have at most 20000000 values, got 400000000"),
    ],
)
def test_a_file_that_would_fill_the_memory_is_refused_in_a_line(
    tmp_path: Path, particles: int, times: int, message: str
) -> None:
    read_tracks(write(tmp_path / "first.nc"))
    with netcdf.Dataset(tmp_path / "drift.nc", "w") as file:
        file.createDimension("trajectory", particles)
        file.createDimension("time", times)
        file.createVariable("time", "f8", ("time",))
        for name in ("lat", "lon"):
            file.createVariable(name, "f4", ("trajectory", "time"), chunksizes=(1, 200))
    with little_memory(), pytest.raises(ValueError) as error:
        read_tracks(tmp_path / "drift.nc")
    assert message in str(error.value) and "\n" not in str(error.value)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files that are no forecasts are refused by what they are."""

from __future__ import annotations

import bz2
import gzip
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import pytest
from drifting import little_memory
from forecasts import SPAN, pair, written
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.world.drift.flow_files import read_forecast
from dsse_ros.world.drift.forecast_files import format_of
from dsse_ros.world.scenario.incident import Incident

netcdf = pytest.importorskip("netCDF4")


def zipped(path: Path, data: bytes) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("u10.nc", data)


OTHERS: dict[str, tuple[Any, str]] = {
    "zip": (zipped, "file must be NetCDF or GRIB, got a zip archive; unpack it"),
    "gzip": (lambda path, data: path.write_bytes(gzip.compress(data)), "compressed by gzip"),
    "bzip2": (lambda path, data: path.write_bytes(bz2.compress(data)), "compressed by bzip2"),
    "a web page": (
        lambda path, data: path.write_text("<!DOCTYPE html>\n<html>"),
        "got text that begins with '<!DOCTYPE html>'",
    ),
    "another text": (
        lambda path, data: path.write_text("52\t-12.4\n"), "text that begins with '52\\t-12.4'",
    ),
    "nothing": (lambda path, data: path.write_bytes(b""), "must be a NetCDF or GRIB file"),
    "the start of a NetCDF file": (
        lambda path, data: path.write_bytes(data[:200]), "must be a NetCDF or GRIB file",
    ),
    "binary": (lambda path, data: path.write_bytes(bytes(999)), "must be a NetCDF or GRIB file"),
}  # fmt: skip


@pytest.mark.parametrize("name", OTHERS)
def test_another_file_is_refused_by_what_it_is(tmp_path: Path, name: str) -> None:
    make, message = OTHERS[name]
    data = written(pair("current", ("uo", "vo")), tmp_path).read_bytes()
    file = tmp_path / "forecast.nc"
    make(file, data)
    with pytest.raises(ValueError) as error:
        read_forecast("current", file, SPAN)
    assert message in str(error.value) and "forecast.nc" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("file_format", ["NETCDF3_CLASSIC", "NETCDF3_64BIT", "NETCDF4"])
@given(text=st.sampled_from(["GRIB", "GRIB\x01\x02", "PK", "BUFR"]), where=st.integers(0, 60))
@settings(deadline=None, max_examples=8)
def test_a_file_is_what_its_first_bytes_state_whatever_words_it_has(
    file_format: str, text: str, where: int
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "era5.nc"
        with netcdf.Dataset(file, "w", format=file_format) as made:
            made.setncattr(f"{text[:4]}_centre", " " * where + text)
            made.createDimension(text[:4], 3)
        assert format_of(file) == "NetCDF"


@pytest.mark.parametrize("before", [b"", b"\x01\r\r\n018 \r\r\nHTXS89 KWBC 171200\r\r\n"])
@pytest.mark.parametrize("edition", [1, 2])
def test_a_grib_file_may_have_the_heading_of_a_bulletin(
    tmp_path: Path, before: bytes, edition: int
) -> None:
    file = tmp_path / "wind.nc"
    file.write_bytes(before + b"GRIB\x00\x01\x02" + bytes([edition]) + bytes(range(256)))
    assert format_of(file) == "GRIB"


def test_an_era5_file_that_names_grib_in_an_attribute_is_read(tmp_path: Path) -> None:
    dataset = pair("wind", ("u10", "v10"), scale=5.0)
    dataset.attrs["GRIB_centre"] = "ecmf"
    file = tmp_path / "era5.nc"
    dataset.to_netcdf(file, format="NETCDF3_CLASSIC")
    assert read_forecast("wind", file, SPAN) == read_forecast(
        "wind", written(dataset, tmp_path), SPAN
    )


def test_a_zarr_store_is_read_as_a_file(tmp_path: Path) -> None:
    zarr = pytest.importorskip("zarr")
    dataset = pair("current", ("uo", "vo"))
    dataset.to_zarr(tmp_path / "forecast.zarr", consolidated=False)
    flow = read_forecast("current", tmp_path / "forecast.zarr", SPAN)
    assert flow == read_forecast("current", written(dataset, tmp_path), SPAN)
    zarr.open_group(str(tmp_path / "giant"), mode="w")
    side = 10**5
    zarr.open_array(
        str(tmp_path / "giant" / "uo"), mode="w", shape=(9, side, side), chunks=(1, side, side),
        dtype="f4",
    )  # fmt: skip
    with little_memory(), pytest.raises(ValueError, match="chunk of uo must have at most 20000000"):
        read_forecast("current", tmp_path / "giant", SPAN)
    (tmp_path / "empty.zarr").mkdir()
    with pytest.raises(ValueError, match="current '.*empty.zarr' must be"):
        read_forecast("current", tmp_path / "empty.zarr", SPAN)


@pytest.mark.parametrize("scheme", ["http", "https", "ftp"])
def test_an_address_is_not_joined_to_a_folder_and_refused_in_a_line(
    tmp_path: Path, scheme: str
) -> None:
    fields = {
        "object": "PIW-1", "search_start": "2026-01-17T13:00Z",
        "seen": {"lat": -24.0, "lon": -46.0, "time": "2026-01-17T12:30Z"},
        # Nobody listens there.
        "current": {"file": f"{scheme}://127.0.0.1:9/thredds/dodsC/sea.nc"},
    }  # fmt: skip
    with pytest.raises(ValueError, match=f"current '{scheme}://127.0.0.1:9/thredds/dodsC/sea.nc'"):
        Incident.read(fields, str(tmp_path))

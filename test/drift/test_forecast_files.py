# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files that are no forecasts are refused by what they are."""

from __future__ import annotations

import bz2
import gzip
import zipfile
from pathlib import Path
from typing import Any

import pytest
from drifting import little_memory
from forecasts import SPAN, pair, written

from dsse_ros.drift.flow_files import read_forecast
from dsse_ros.scenario.incident import Incident


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

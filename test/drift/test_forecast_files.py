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
from forecasts import SPAN, pair, written

from dsse_ros.drift.flow_files import read_forecast


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

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files of forecasts, opened by what they are."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Literal

from dsse_ros.base.extras import pip_install
from dsse_ros.world.drift.grib import open_grib
from dsse_ros.world.drift.netcdf import Unfit, check_at_once, opened

_SNIFFED = 4096
_NETCDF = (b"CDF\x01", b"CDF\x02", b"CDF\x05")
_HDF5 = b"\x89HDF\r\n\x1a\n"
_USER_BLOCKS = (512, 1024, 2048)
_GRIB = re.compile(rb"[\x00-\x7f]{0,200}?GRIB...[\x01\x02]", re.DOTALL)
"""The first message has a number of its edition; weather services put some lines before it."""
_OTHERS = (
    (b"PK\x03\x04", "a zip archive; unpack it"),
    (b"\x1f\x8b", "compressed by gzip; unpack it"),
    (b"BZh", "compressed by bzip2; unpack it"),
    (b"\xfd7zXZ", "compressed by xz; unpack it"),
    (b"%PDF", "a PDF"),
    (b"II*\x00", "a TIFF image"),
    (b"MM\x00*", "a TIFF image"),
    (b"\x89PNG", "a PNG image"),
    (b"BUFR", "BUFR"),
)
"""First bytes of files that are no forecasts."""


@contextmanager
def opened_forecast(path: str, select: Mapping[str, Any]) -> Iterator[list[Any]]:
    """Open a file or an address as `xarray` data sets, with times as numbers.

    A NetCDF file, an OPeNDAP address or a zarr store is one data set; a GRIB file is one for each
    kind of level.

    Args:
        path: The file or the address.
        select: Values of dimensions, see `open_grib`.

    Raises:
        OSError: If there is no such file.
        Unfit: If it is not a forecast.
        ValueError: What xarray raises; if an axis or a chunk is too large.
    """
    if _is_zarr(path):
        with _opened_zarr(path) as dataset:
            yield [dataset]
    elif "://" not in path and format_of(path) == "GRIB":
        yield open_grib(path, select)
    else:
        with opened(path) as dataset:
            yield [dataset]


def format_of(path: str | os.PathLike[str]) -> Literal["NetCDF", "GRIB", ""]:
    """Return what a file is by its first bytes, "" if they do not state it.

    Raises:
        OSError: If there is no such file.
        Unfit: If it is of another kind.
    """
    with open(path, "rb") as file:
        first = file.read(_SNIFFED)
    # HDF5 may have a block of the user's before it.
    if first.startswith((*_NETCDF, _HDF5)) or _HDF5 in (first[at : at + 8] for at in _USER_BLOCKS):
        return "NetCDF"
    for start, what in _OTHERS:
        if first.startswith(start):
            raise Unfit(f"file must be NetCDF or GRIB, got {what}")
    if _GRIB.match(first) or first == b"GRIB":
        return "GRIB"
    if _is_text(first):
        line = first.decode("utf-8", "replace").strip().splitlines()[0][:60]
        raise Unfit(f"file must be NetCDF or GRIB, got text that begins with {line!r}")
    return ""


def _is_zarr(path: str) -> bool:
    return path.rstrip("/").endswith(".zarr") or any(
        os.path.exists(os.path.join(path, name)) for name in ("zarr.json", ".zgroup")
    )


@contextmanager
def _opened_zarr(path: str) -> Iterator[Any]:
    """Open a zarr store as an `xarray.Dataset`, with times as numbers; raise what xarray raises.

    Raises:
        Unfit: If zarr is missing.
        ValueError: If an axis or a chunk is too large; one line.
    """
    try:
        import zarr
    except ModuleNotFoundError:
        raise Unfit(f"zarr is missing; {pip_install('zarr')}") from None
    import xarray
    from xarray.backends import ZarrBackendEntrypoint

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, array in zarr.open_group(path, mode="r").arrays():
            check_at_once(name, array.size if array.ndim == 1 else 0, array.chunks)
        with xarray.open_dataset(
            path, engine=ZarrBackendEntrypoint, decode_times=False, cache=False, chunks=None
        ) as dataset:
            yield dataset


def _is_text(first: bytes) -> bool:
    return bool(first.strip()) and all(byte >= 32 or byte in b"\t\r\n\f" for byte in first)

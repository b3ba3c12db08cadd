# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files of forecasts, opened by what they are."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from dsse_ros.drift.grib import open_grib
from dsse_ros.drift.netcdf import Unfit, check_at_once, opened
from dsse_ros.extras import pip_install

_SNIFFED = 4096
_OTHERS = (
    (b"PK\x03\x04", "a zip archive; unpack it"),
    (b"\x1f\x8b", "compressed by gzip; unpack it"),
    (b"BZh", "compressed by bzip2; unpack it"),
    (b"\xfd7zXZ", "compressed by xz; unpack it"),
    (b"%PDF", "a PDF"),
    (b"II*\x00", "a TIFF image"),
    (b"MM\x00*", "a TIFF image"),
    (b"\x89PNG", "a PNG image"),
)
"""First bytes of files that are no forecasts."""


@contextmanager
def opened_forecast(path: str) -> Iterator[list[Any]]:
    """Open a file or an address as `xarray` data sets, with times as numbers.

    A NetCDF file, an OPeNDAP address or a zarr store is one data set; a GRIB file is one for each
    kind of level.

    Raises:
        OSError: If there is no such file.
        Unfit: If it is not a forecast.
        ValueError: What xarray raises; if an axis or a chunk is too large.
    """
    if _is_zarr(path):
        with _opened_zarr(path) as dataset:
            yield [dataset]
        return
    first = _first_bytes(path)
    # Messages of weather services have a header of some lines.
    if b"GRIB" in first[:200]:
        yield open_grib(path)
        return
    for start, what in _OTHERS:
        if first.startswith(start):
            raise Unfit(f"file must be NetCDF or GRIB, got {what}")
    if not first.startswith((b"CDF", b"\x89HDF")) and _is_text(first):
        line = first.decode("utf-8", "replace").strip().splitlines()[0][:60]
        raise Unfit(f"file must be NetCDF or GRIB, got text that begins with {line!r}")
    with opened(path) as dataset:
        yield [dataset]


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


def _first_bytes(path: str) -> bytes:
    """Return the first bytes of a file, none of an address."""
    if "://" in path:
        return b""
    with open(path, "rb") as file:
        return file.read(_SNIFFED)


def _is_text(first: bytes) -> bool:
    return bool(first.strip()) and all(byte >= 32 or byte in b"\t\r\n\f" for byte in first)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""NetCDF files, opened by xarray (extra `drift`), and the times in them."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.extras import pip_install
from dsse_ros.world.drift.flow import seconds

MAX_AT_ONCE = 20_000_000
"""Values of an axis or a chunk at most; either is read as a whole."""
_CALENDARS = ("standard", "gregorian", "proleptic_gregorian")
_SPELLINGS = {"": "standard", "gregorian_proleptic": "proleptic_gregorian"}


class Unfit(Exception):
    """Why a file cannot be used, in one line without the name of the file."""


def check_installed(what: str) -> None:
    """Check that the packages that read NetCDF are installed.

    Args:
        what: What is to be read, for the error.

    Raises:
        ValueError: If one is missing; one line.
    """
    try:
        import netCDF4  # noqa: F401  xarray reads with it.
        import xarray  # noqa: F401
    except ModuleNotFoundError as error:
        raise ValueError(f"{what}: {error.name} is missing; {pip_install('drift')}") from None


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[Any]:
    """Open a file as an `xarray.Dataset`, with times as numbers; raise what xarray raises.

    Raises:
        ValueError: If an axis or a chunk is too large; one line.
    """
    import xarray
    from xarray.backends import NetCDF4BackendEntrypoint

    _check_sizes(path)
    with warnings.catch_warnings():
        # xarray warns of things that it handles itself or that the readers refuse.
        warnings.simplefilter("ignore")
        with xarray.open_dataset(
            # By its name, xarray would load every other engine, too.
            path,
            engine=NetCDF4BackendEntrypoint,
            decode_times=False,
            cache=False,
        ) as dataset:
            yield dataset


def _check_sizes(path: str | os.PathLike[str]) -> None:
    """Check that no axis and no chunk is too large, before any of them is read."""
    import netCDF4

    with netCDF4.Dataset(path) as file:
        for name, variable in file.variables.items():
            chunks = variable.chunking()
            axis = variable.size if name in file.dimensions else 0
            check_at_once(name, axis, chunks if isinstance(chunks, list) else ())


def check_at_once(name: str, axis: int, chunks: Sequence[int]) -> None:
    """Check what is read of a variable as a whole.

    Args:
        name: Its name.
        axis: Values of it as an axis; 0 for a variable that is read in parts.
        chunks: Sides of a chunk; none without chunks.

    Raises:
        ValueError: If it is too large.
    """
    for what, size in (("axis", axis), ("chunk", math.prod(chunks) if len(chunks) else 0)):
        if size > MAX_AT_ONCE:
            raise ValueError(f"{what} of {name} must have at most {MAX_AT_ONCE} values, got {size}")


def filled(values: Any, dtype: type[np.floating[Any]] = np.float64) -> NDArray[Any]:
    """Return values of a file as numbers, NaN where there are none."""
    numbers: NDArray[Any] = np.ma.filled(np.ma.asarray(values, dtype), np.nan)
    return numbers


def in_seconds(
    times: NDArray[np.float64], units: str, calendar: str = "standard"
) -> NDArray[np.float64]:
    """Return times of a file in seconds since 1970-01-01 UTC, (T,) float64.

    Args:
        times: (T,).
        units: CF units such as `hours since 1900-01-01`.
        calendar: CF calendar, in any case.

    Raises:
        Unfit: If units or calendar are not those of CF, or a time is missing; what times must have.
    """
    import cftime

    calendar = _SPELLINGS.get(calendar.lower(), calendar.lower())
    if calendar not in _CALENDARS:
        raise Unfit(f"the standard calendar, got {calendar!r}")
    values = filled(np.atleast_1d(times))
    if not values.size or not np.isfinite(values).all():
        raise Unfit("values without gaps")
    low, high = values.min(), values.max()
    try:
        # The units are linear, so the ends of a long axis suffice.
        dates = cftime.num2date([low, high], units, calendar)
        ends = cftime.date2num(dates, "seconds since 1970-01-01", calendar)
    except (OverflowError, TypeError, ValueError):
        raise Unfit(f"units like 'hours since 1900-01-01', got {units!r}") from None
    share = (values - low) / (high - low) if high > low else np.zeros(len(values))
    return np.asarray(ends[0] + share * (ends[1] - ends[0]), np.float64)


def _of_texts(times: NDArray[Any]) -> NDArray[np.float64]:
    """Return times of WRF, such as `2026-01-17_12:00:00`, in seconds since 1970-01-01 UTC."""
    try:
        texts = [time.decode() if isinstance(time, bytes) else str(time) for time in times]
        return np.array([seconds(text.strip().replace("_", "T")) for text in texts], np.float64)
    except ValueError:
        raise Unfit(f"times like 2026-01-17_12:00:00, got {str(times[:1].tolist())[:60]}") from None


def times_of(variable: Any) -> NDArray[np.float64]:
    """Return the times of an `xarray` variable in seconds since 1970-01-01 UTC, (T,) float64.

    Raises:
        Unfit: See `in_seconds`.
    """
    about = variable.attrs
    try:
        if variable.dtype.kind in "SUO":
            return _of_texts(np.atleast_1d(variable.values))
        return in_seconds(
            variable.values, str(about.get("units", "")), str(about.get("calendar", ""))
        )
    except Unfit as unfit:
        raise Unfit(f"{variable.name} must have {unfit}") from None

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""GRIB files, editions 1 and 2, opened by cfgrib (extra `grib`)."""

from __future__ import annotations

import logging
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from dsse_ros.drift.netcdf import MAX_AT_ONCE, Unfit
from dsse_ros.extras import pip_install

MAX_MESSAGES = 100_000
UV_ALONG_GRID = "uvRelativeToGrid"
"""Key that is 1 for components along the axes of the grid."""


def open_grib(path: str | os.PathLike[str]) -> list[Any]:
    """Return the fields of a file as `xarray` data sets, one for each kind of level.

    Raises:
        Unfit: If it cannot be read, or cfgrib is missing.
    """
    try:
        import cfgrib
        import eccodes
    except ModuleNotFoundError as error:
        raise Unfit(f"{error.name} is missing; {pip_install('grib')}") from None
    try:
        _check_messages(path)
        with warnings.catch_warnings(), _quiet("cfgrib"):
            warnings.simplefilter("ignore")
            # An index would be a file beside the forecast.
            keys = {"indexpath": "", "read_keys": [UV_ALONG_GRID]}
            return list(
                cfgrib.open_datasets(os.fspath(path), backend_kwargs=keys, decode_times=False)
            )
    except (
        EOFError,
        OSError,
        ValueError,
        eccodes.CodesInternalError,
        cfgrib.DatasetBuildError,
    ) as error:
        raise Unfit(f"file must be GRIB: {' '.join(str(error).split())[:200]}") from None


def _check_messages(path: str | os.PathLike[str]) -> None:
    """Check that no message is too large, before any of them is read.

    Raises:
        Unfit: If one is.
    """
    import eccodes

    count = 0
    with open(path, "rb") as file:
        for message in _messages(file):
            points = eccodes.codes_get_long(message, "numberOfDataPoints")
            if points > MAX_AT_ONCE:
                raise Unfit(f"a field must have at most {MAX_AT_ONCE} values, got {points}")
            count += 1
            if count > MAX_MESSAGES:
                raise Unfit(f"file must have at most {MAX_MESSAGES} fields")
    if not count:
        raise Unfit("file must have fields, got none")


def _messages(file: Any) -> Iterator[Any]:
    import eccodes

    while (message := eccodes.codes_grib_new_from_file(file, headers_only=True)) is not None:
        try:
            yield message
        finally:
            eccodes.codes_release(message)


@contextmanager
def _quiet(name: str) -> Iterator[None]:
    """Keep a logger from logging what becomes an error here."""
    logger = logging.getLogger(name)
    disabled, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = disabled

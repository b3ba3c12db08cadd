# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files in NumPy's format (.npy), whose headers are checked before any memory is allocated."""

from __future__ import annotations

from collections.abc import Callable
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

_KINDS = "fiu"
"""NumPy's kinds of numbers."""

_READERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
"""Readers by version; version 3 is for field names beyond Latin-1."""


def array_header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Return shape and type of the array in a file, and leave the file at its values.

    Raises:
        ValueError: If the file does not begin with an array header.
    """
    version = np.lib.format.read_magic(file)
    if version not in _READERS:
        raise ValueError(f"version of the header of an array must be 1 or 2, got {version}")
    shape, _, dtype = _READERS[version](file)
    return shape, dtype


def check_numbers(dtype: np.dtype[Any]) -> None:
    """Raise unless arrays of this type have real numbers.

    Raises:
        ValueError: If they do not.
    """
    if dtype.kind not in _KINDS:
        raise ValueError(f"type of an array must be a number, got {dtype}")


def read_npy(path: str, check_shape: Callable[[tuple[int, ...]], None]) -> NDArray[Any]:
    """Return the array of numbers in a file.

    Args:
        path: Path of the file.
        check_shape: Raises a ValueError for a shape that is not allowed.

    Raises:
        OSError, ValueError: If the file cannot be read as such an array.
    """
    array = np.lib.format.open_memmap(path, mode="r")
    check_shape(array.shape)
    check_numbers(array.dtype)
    return np.array(array)

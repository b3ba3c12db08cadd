# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Headers of files in NumPy's format (.npy), read before any memory is allocated."""

from __future__ import annotations

from typing import IO, Any

import numpy as np

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

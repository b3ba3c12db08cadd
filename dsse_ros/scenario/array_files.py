# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a file in NumPy's format (.npy) says of its array, before there is memory for it."""

from __future__ import annotations

from typing import IO, Any

import numpy as np

_READERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
"""By version; a third one is for names of fields beyond Latin-1."""


def array_header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Return shape and type of the array that a file begins with; its values follow.

    Raises:
        ValueError: If it begins with none.
    """
    version = np.lib.format.read_magic(file)
    if version not in _READERS:
        raise ValueError(f"version {version} of the header of an array is not allowed; 1 or 2")
    shape, _, dtype = _READERS[version](file)
    return shape, dtype

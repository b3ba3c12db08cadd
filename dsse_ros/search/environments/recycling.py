# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Arrays that belong to the caller, without new memory for each one."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

KEPT = 3
"""Arrays kept for reuse: one being written, and two that a caller compares."""


class Recycler:
    """Arrays of one shape and type, whose memory is reused once nothing refers to it.

    A returned array, its views, and anything else that shares its memory by Python's rules (a
    tensor, a memory view) keep their contents while they exist. Allocating new memory takes longer
    than writing to existing memory.

    Args:
        shape: Of the arrays.
        dtype: Of the arrays.
        overwrite: Whether to return the same memory each time, even if it is still in use.
    """

    def __init__(
        self, shape: tuple[int, ...], dtype: DTypeLike, *, overwrite: bool = False
    ) -> None:
        self._shape = shape
        self._dtype = np.dtype(dtype)
        self._overwrite = overwrite
        self._owners: list[NDArray[Any]] = []

    def take(self) -> NDArray[Any]:
        """Return an array with arbitrary content."""
        for i in range(len(self._owners)):
            # Views, and views of views, refer to the array that owns the memory.
            if self._overwrite or _references(self._owners, i) == _UNUSED:
                return self._owners[i].view()
        self._owners.append(np.empty(self._shape, self._dtype))
        del self._owners[:-KEPT]
        return self._owners[-1].view()

    def __getstate__(self) -> dict[str, Any]:
        # A copy must not share memory with the original.
        return {**vars(self), "_owners": []}


def _references(owners: list[NDArray[Any]], i: int) -> int:
    return sys.getrefcount(owners[i])


# The references of the list and of `_references` itself.
_UNUSED = _references([np.empty(0)], 0)

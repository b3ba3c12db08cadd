# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Arrays that belong to their receiver, without new memory for each."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

KEPT = 3
"""Arrays kept for later: one that is being written, and two that a caller compares."""


class Recycler:
    """Arrays of one shape and type; memory is used again once nothing refers to it any more.

    An array that is handed out, a view of it, or whatever else shares its memory by Python's
    rules (a tensor, a memory view) stays as it is for as long as it exists. New memory costs the
    system more time than writing to memory that is there.

    Args:
        shape: Of the arrays.
        dtype: Of the arrays.
        overwrite: Whether to hand out the same memory each time, even if it is still referred to.
    """

    def __init__(
        self, shape: tuple[int, ...], dtype: DTypeLike, *, overwrite: bool = False
    ) -> None:
        self._shape = shape
        self._dtype = np.dtype(dtype)
        self._overwrite = overwrite
        self._owners: list[NDArray[Any]] = []

    def take(self) -> NDArray[Any]:
        """Return an array with any content."""
        for i in range(len(self._owners)):
            # Views refer to the array that owns the memory, views of views too.
            if self._overwrite or _references(self._owners, i) == _UNUSED:
                return self._owners[i].view()
        self._owners.append(np.empty(self._shape, self._dtype))
        del self._owners[:-KEPT]
        return self._owners[-1].view()

    def __getstate__(self) -> dict[str, Any]:
        # A copy hands out memory of its own.
        return {**vars(self), "_owners": []}


def _references(owners: list[NDArray[Any]], i: int) -> int:
    return sys.getrefcount(owners[i])


# What the list and the question itself count for.
_UNUSED = _references([np.empty(0)], 0)

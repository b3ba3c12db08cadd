# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Gaps of a field, as at the coast of a coarse model, filled from the nearest values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def fill_gaps(
    east: NDArray[np.float32], north: NDArray[np.float32], gaps: NDArray[np.bool_], cells: int
) -> int:
    """Fill gaps near values, time by time, in place; return the number of cells filled.

    Args:
        east: (T, Y, X).
        north: (T, Y, X).
        gaps: (T, Y, X), where one of them has no value.
        cells: Greatest distance of the value.
    """
    from scipy.ndimage import distance_transform_edt

    filled = np.zeros(gaps.shape[1:], np.bool_)
    before, near, rows, cols = None, filled, filled, filled
    for number, gap in enumerate(gaps):
        if gap.all() or not gap.any():
            continue
        if before is None or not np.array_equal(gap, before):
            distance, (rows, cols) = distance_transform_edt(gap, return_indices=True)
            near, before = gap & (distance <= cells), gap
        for values in (east[number], north[number]):
            values[near] = values[rows[near], cols[near]]
        filled |= near
    return int(filled.sum())

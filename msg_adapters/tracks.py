# SPDX-License-Identifier: Apache-2.0
"""Flown tracks reduced to the cells that matter."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def without_repeats(cells: ArrayLike) -> NDArray[Any]:
    """Return a track (K, 2) with each run of equal cells merged into one."""
    track = np.asarray(cells).reshape(-1, 2)
    keep = np.ones(len(track), dtype=bool)
    keep[1:] = (track[1:] != track[:-1]).any(axis=1)
    return track[keep]


def corners(cells: ArrayLike) -> NDArray[Any]:
    """Return the ends of a track (K, 2) and the cells in which it turns: the same line."""
    track = without_repeats(cells)
    if len(track) < 3:
        return track
    legs = np.diff(track, axis=0)
    before, after = legs[:-1], legs[1:]
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    along = (before * after).sum(axis=1)
    keep = np.ones(len(track), dtype=bool)
    keep[1:-1] = (cross != 0) | (along < 0)
    return track[keep]

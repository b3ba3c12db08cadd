# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Flown tracks reduced to the cells that matter."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def without_repeats(cells: ArrayLike) -> NDArray[Any]:
    """Return a track (K, 2) with each run of equal cells merged into one."""
    track = np.asarray(cells).reshape(-1, 2)
    return track[_arrivals(track)]


def corners(cells: ArrayLike) -> NDArray[Any]:
    """Return the ends of a track (K, 2) and the cells in which it turns: the same line."""
    track = without_repeats(cells)
    return track[_turns(track)]


def stops(
    cells: ArrayLike, searched: ArrayLike, *, merge_legs: bool
) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Return the cells that a vehicle has to fly to, and how often each is searched on that stop.

    Args:
        cells: (K, 2) of (col, row).
        searched: (K,) flags; index k says whether the drone came to be in `cells[k]` by searching
            it, and not by moving there.
        merge_legs: Whether cells on a straight leg are left out, but for those searched.

    Returns:
        (M, 2) cells and (M,) numbers of searches.

    Raises:
        ValueError: If the shapes do not match.
    """
    track = np.asarray(cells).reshape(-1, 2)
    flags = np.asarray(searched, dtype=bool)
    if flags.shape != (len(track),):
        raise ValueError(f"searched must be one flag per cell, ({len(track)},), got {flags.shape}")
    arrived = _arrivals(track)
    visit = np.cumsum(arrived) - 1
    searches = np.bincount(visit, weights=flags, minlength=int(arrived.sum())).astype(np.int64)
    track = track[arrived]
    if merge_legs:
        keep = _turns(track) | (searches > 0)
        track, searches = track[keep], searches[keep]
    return track, searches


def _arrivals(track: NDArray[Any]) -> NDArray[np.bool_]:
    """Return (K,) flags: whether the cell differs from the one before."""
    arrived = np.ones(len(track), dtype=bool)
    arrived[1:] = (track[1:] != track[:-1]).any(axis=1)
    return arrived


def _turns(track: NDArray[Any]) -> NDArray[np.bool_]:
    """Return (K,) flags of the ends and turns of a track without repeats."""
    keep = np.ones(len(track), dtype=bool)
    if len(track) >= 3:
        legs = np.diff(track, axis=0)
        before, after = legs[:-1], legs[1:]
        cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        along = (before * after).sum(axis=1)
        keep[1:-1] = (cross != 0) | (along < 0)
    return keep

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tracks as polylines: points (M, 2) with straight legs between them, and where drones are on them.

A drone that turns on the spot flies straight to the farthest point of its track that it reaches in
a step without cutting a corner by more than a tolerance. One with a turn radius flies towards the
point that is a step ahead.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SAMPLES = 64
"""Points of a track that a drone may fly to in a step, among which it chooses."""
HALVINGS = 10
"""Halvings of the way between the farthest point within reach and the next one."""


def along(points: Floats) -> Floats:
    """Return the length of a track to each of its points, (K,)."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])


def points_at(points: Floats, lengths: Floats) -> Floats:
    """Return the points of a track at these lengths of it, (..., 2)."""
    known = along(points)
    return np.stack([np.interp(lengths, known, points[:, axis]) for axis in (0, 1)], axis=-1)


def nearest(points: Floats, position: Floats, lengths: Floats) -> float:
    """Return at which of these lengths of a track its point is nearest to a position (2,)."""
    away = np.hypot(*(points_at(points, lengths) - position).T)
    return float(lengths[np.argmin(away)])


def goal_within_reach(
    points: Floats, position: Floats, flown: float, reach: float, carried: Floats, tolerance: float
) -> tuple[float, Floats]:
    """Return where on a track a drone flies to in a step, as a length of the track and a point.

    Args:
        points: (M, 2) float64, the track.
        position: (2,) float64, the drone.
        flown: Length of the track up to the drone.
        reach: How far the drone flies through the air.
        carried: (2,) float64, how far the wind carries it, relative to the track.
        tolerance: Greatest distance of a straight flight from the track; inf for a drone that
            cannot fly straight there.
    """

    def within_reach(goals: Floats) -> NDArray[np.bool_]:
        return np.hypot(*(goals - position - carried).T) <= reach

    lengths = flown + (reach + math.hypot(*carried)) * np.arange(SAMPLES + 1) / SAMPLES
    goals = points_at(points, lengths)
    allowed = within_reach(goals)
    if tolerance < math.inf:
        allowed &= _deviations(position, goals) <= tolerance
    allowed[0] = True
    last = int(np.argmin(allowed)) - 1 if not allowed.all() else SAMPLES
    low = float(lengths[last])
    if last < SAMPLES and not within_reach(goals[last + 1]):
        high = float(lengths[last + 1])
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            if within_reach(points_at(points, np.array(middle))):
                low = middle
            else:
                high = middle
    return low, points_at(points, np.array(low))


def _deviations(start: Floats, points: Floats) -> Floats:
    """Return how far a track leads from the straight line to each of its points, (S,).

    Args:
        start: (2,) float64, where the lines begin.
        points: (S, 2) float64, points of the track.
    """
    lines = points - start
    squared = np.maximum((lines**2).sum(axis=1), 1e-12)
    away = points[None] - start
    share = np.clip((away * lines[:, None]).sum(axis=2) / squared[:, None], 0.0, 1.0)
    distance = np.hypot(*np.moveaxis(away - share[..., None] * lines[:, None], 2, 0))
    before = np.tri(len(points), dtype=bool)
    return np.where(before, distance, 0.0).max(axis=1)

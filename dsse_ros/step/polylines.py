# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tracks as polylines: points (M, 2) with straight legs between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def along(points: Floats) -> Floats:
    """Return the length of a track to each of its points, (K,)."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])


def points_at(points: Floats, lengths: Floats) -> Floats:
    """Return the points of a track at these lengths of it, (..., 2)."""
    known = along(points)
    return np.stack([np.interp(lengths, known, points[:, axis]) for axis in (0, 1)], axis=-1)

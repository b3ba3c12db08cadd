# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether what was counted agrees with what was expected: Pearson's chi-square, in sigmas."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

LEAST = 10.0
"""Cells in which fewer are expected count together."""
SIGMAS = 6.0
"""Two samples of one law differ by more once in a thousand million times."""


def excess(
    counts: NDArray[np.int64], chances: NDArray[np.float64], inflation: float = 1.0
) -> float:
    """Return by how many standard deviations chi-square exceeds its mean.

    Args:
        counts: (K,) how often each of K results was counted.
        chances: (K,) how probable each is; they sum to 1.
        inflation: Variance of a count over that of N independent draws from the chances; above 1
            where the chances are themselves those of a sample.
    """
    total = int(counts.sum())
    expected = chances * total
    few = expected < LEAST
    counted = np.append(counts[~few], counts[few].sum()).astype(np.float64)
    wanted = np.append(expected[~few], expected[few].sum())
    # Of what is hardly expected at all, a few do not weigh more than chance allows.
    spread = np.maximum(wanted, 1.0) * inflation
    chi_square = float(((counted - wanted) ** 2 / spread).sum())
    freedom = max(len(counted) - 1, 1)
    return (chi_square - freedom) / math.sqrt(2.0 * freedom)

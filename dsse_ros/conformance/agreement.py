# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Agreement of counts with expectations: Pearson's chi-square, in standard deviations."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

LEAST = 10.0
"""Cells with a smaller expected count are pooled."""
SIGMAS = 6.0
"""Samples of the same distribution differ by more than this once in a billion times."""


def excess(
    counts: NDArray[np.int64], chances: NDArray[np.float64], inflation: float = 1.0
) -> float:
    """Return the excess of chi-square over its mean, in standard deviations.

    Args:
        counts: (K,) count of each of K results.
        chances: (K,) probability of each result; they sum to 1.
        inflation: Variance of a count over that of N independent draws from the chances; above 1
            if the chances are estimated from a sample.
    """
    total = int(counts.sum())
    expected = chances * total
    few = expected < LEAST
    counted = np.append(counts[~few], counts[few].sum()).astype(np.float64)
    wanted = np.append(expected[~few], expected[few].sum())
    # Limit the weight of a few counts where hardly any are expected.
    spread = np.maximum(wanted, 1.0) * inflation
    chi_square = float(((counted - wanted) ** 2 / spread).sum())
    freedom = max(len(counted) - 1, 1)
    return (chi_square - freedom) / math.sqrt(2.0 * freedom)

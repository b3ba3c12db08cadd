# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Multiplies a belief by factors of each place, of searches and of reports by others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.belief.belief import Belief
from dsse_ros.search.belief.component_kernels import NOTHING_LEFT
from dsse_ros.search.belief.ensemble_belief import EnsembleBelief


def weigh(belief: Belief | EnsembleBelief, factors: NDArray[np.float64], *, searched: bool) -> bool:
    """Multiply the probability of each place of a belief by a factor, and scale it to 1.

    If nothing would be left, the factors contradict all that is known: nothing is learned.

    Args:
        belief: The belief.
        factors: (M,) by place, (C, M) by detection class and place, or of the shape of the density;
            of a search its 1 - POD.
        searched: Whether a search was made, which counts in the POS.

    Returns:
        Whether anything was learned.
    """
    density = belief.density
    rows = density.reshape(len(belief.examples), -1, density.shape[-1])
    totals = rows.sum(axis=(1, 2))
    if factors.shape == density.shape:
        factors = factors.reshape(rows.shape)
    elif factors.ndim == 2:
        factors = factors[:, None]
    weighed = rows * factors
    after = weighed.sum(axis=(1, 2))
    if searched:
        hazard = 1.0 - after / totals
        belief.unfound *= 1.0 - hazard[belief.class_of]
        belief.pos = float((1.0 - belief.unfound).mean())
    kept = after >= NOTHING_LEFT * totals
    scale = np.where(kept, totals / np.where(kept, after, 1.0), 1.0)
    rows[:] = np.where(kept[:, None, None], weighed * scale[:, None, None], rows)
    belief.density = density
    return bool(kept.any())

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""No joint paths are worth more than the bound, which is not far above the best ones."""

from __future__ import annotations

import numpy as np
import pytest
from rings import best_of_all, problem

from benchmarks.paths.bound import upper_bound


@pytest.mark.parametrize("seed", range(3))
def test_the_best_paths_are_below_the_bound_and_near_it(seed: int) -> None:
    path_problem = problem(seed, 2, 0.5)
    best = best_of_all(path_problem)
    assert best - 1e-9 <= upper_bound(path_problem, 50, np.random.default_rng(0)) <= 1.3 * best

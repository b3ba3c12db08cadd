# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A drifting map is the given one, moved by whole cells."""

from __future__ import annotations

import numpy as np

from dsse_ros.belief.beliefs import forecast_for
from dsse_ros.scenario.rules import profile
from dsse_ros.scenario.scenario import Scenario


def test_the_belief_is_the_given_map_moved_by_the_drift() -> None:
    matrix = np.zeros((8, 8))
    matrix[1:4, 2:4] = [[1, 2], [3, 4], [5, 6]]
    scenario = Scenario(grid_size=8, probability_matrix=matrix, vector=(0.5, 0.0))
    belief = forecast_for(scenario, profile("paper", person_motion="drifting_map")).belief()
    for cells in (0, 1, 1, 2):
        assert np.allclose(belief.poc(), np.roll(matrix, cells, axis=1) / matrix.sum())
        belief.advance()

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A random walk takes the stated steps, and shares out those that would leave the grid."""

from __future__ import annotations

import numpy as np
import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario

STEPS = (0.0, 0.1, 0.0, 0.2, 0.4, 0.1, 0.0, 0.2, 0.0)


@pytest.mark.parametrize("cell", [(1, 1), (0, 1), (2, 0)])
def test_steps_out_of_the_grid_are_shared_among_the_other_moves(cell: tuple[int, int]) -> None:
    rules = profile("paper", person_motion="random_walk", person_steps=STEPS)
    belief = forecast_for(Scenario(grid_size=3, person_initial_position=cell), rules).belief()
    belief.advance()
    want = np.zeros((5, 5))
    want[cell[1] : cell[1] + 3, cell[0] : cell[0] + 3] = np.reshape(STEPS, (3, 3))
    want[cell[1] + 1, cell[0] + 1] = 0.0
    inner = want[1:-1, 1:-1]
    inner *= 0.6 / inner.sum()
    inner[cell[1], cell[0]] = 0.4
    assert np.allclose(belief.poc(), inner, atol=1e-12)


@pytest.mark.parametrize("steps", [(1.0,), (0.2,) * 9, (-0.1, 1.1, 0, 0, 0, 0, 0, 0, 0)])
def test_steps_that_are_no_probabilities_are_refused(steps: tuple[float, ...]) -> None:
    with pytest.raises(FieldError, match="^person_steps must be"):
        profile("paper", person_steps=steps)

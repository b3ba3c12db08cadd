# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The masks of all cells, against the moves by their names."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.search.step.constants import constants_of
from dsse_ros.search.step.masks import mask_table
from dsse_ros.world.scenario.actions import ACTION_VECTORS
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario


@given(st.permutations(list(ACTION_VECTORS)), st.integers(1, 6), st.booleans(), st.data())
def test_a_mask_allows_the_moves_that_stay_on_the_grid_and_in_the_area(
    names: list[str], size: int, whole: bool, data: st.DataObject
) -> None:
    rules = profile("paper").override(actions=names)
    scenario = Scenario(grid_size=size, num_drones=1).resolve(rules)
    rows = st.lists(st.booleans(), min_size=size, max_size=size)
    area = np.array(data.draw(st.lists(rows, min_size=size, max_size=size)))
    searched = np.pad(np.ones_like(area) if whole else area, 1)
    table = mask_table(constants_of(scenario, rules), None if whole else area)
    distinct = {}
    for row, col in np.ndindex(size, size):
        mask = table[row][col]
        ends = [(row + dy + 1, col + dx + 1) for dx, dy in (ACTION_VECTORS[name] for name in names)]
        assert mask.tolist() == [int(searched[end]) for end in ends]
        assert not mask.flags.writeable and distinct.setdefault(mask.tobytes(), mask) is mask

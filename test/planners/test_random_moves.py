# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the random planner."""

from __future__ import annotations

from collections import Counter

import pytest
from grid_walker import DIAGONAL, STRAIGHT, GridWalker

from dsse_ros.planners.registry import make_planner


@pytest.mark.parametrize("actions", [STRAIGHT, DIAGONAL])
@pytest.mark.parametrize("cell", [(0, 0), (1, 0), (1, 1), (2, 1), (2, 2)])
def test_every_allowed_action_is_drawn_equally_often(
    cell: tuple[int, int], actions: tuple[str, ...]
) -> None:
    walker = GridWalker(3, [cell], actions)
    planner = make_planner("random", actions, seed=1)
    drawn: Counter[int] = Counter()
    for _ in range(4000):
        drawn.update(walker.step(planner).values())
        walker.cells["drone0"] = cell
    allowed = walker.mask("drone0").nonzero()[0].tolist()
    assert sorted(drawn) == allowed
    expected = 4000 / len(allowed)
    # Chi-squared with at most 8 degrees of freedom exceeds 26.1 once in a thousand seeds.
    assert sum((count - expected) ** 2 / expected for count in drawn.values()) < 26.1


def test_drones_whose_draws_end_in_one_cell_do_not_all_move() -> None:
    planner = make_planner("random", STRAIGHT, seed=0)
    held = 0
    for _ in range(200):
        walker = GridWalker(2, [(0, 0), (1, 1)])
        names = [STRAIGHT[action] for action in walker.step(planner).values()]
        held += names in (["right", "search"], ["down", "search"])
    assert held > 20

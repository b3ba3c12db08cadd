# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A drone whose vehicle has dropped out, without ROS."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsse_ros.mission.mission import Mission
from dsse_ros.search import HOLD, Snapshot, parallel_env

FIELDS: dict[str, Any] = {
    "grid_size": 12,
    "drones_positions": [(1, 1), (6, 6), (5, 2)],
    "person_initial_position": (9, 9),
    "probability_of_detection": 0.0,
    "timestep_limit": 40,
}
RULES = ["paper", "v1", "v2"]


def mission(rules: str, **changes: Any) -> Mission:
    return Mission(parallel_env(rules=rules, **(FIELDS | changes)), seed=3)


@pytest.mark.parametrize("rules", RULES)
def test_a_lost_drone_stays_terminated_where_it_was_and_the_others_go_on(rules: str) -> None:
    made = mission(rules)
    right = made.env.rules.actions.index("right")
    made.command_all([right] * 3)
    made.advance("hold")
    assert made.lose(1) and not made.lose(1)
    assert made.lost == [1] and made.live == [0, 2] and made.missing == [0, 2]
    assert made.result.terminated.tolist() == [False, True, False]
    refused = made.refuse(1)
    assert refused is not None and refused.code == "drone_terminated"
    for _ in range(2):
        made.command_all([right] * 3)
        result = made.advance("hold")
        assert result.terminated.tolist() == [False, True, False]
        assert result.actions.tolist() == [right, HOLD, right]
        assert result.cells[1].tolist() == [7, 6] and not result.held[1]
        assert result.rewards[1] == 0.0
        assert made.env.agents == ["drone0", "drone2"]
    made.reset(4)
    assert made.lost == [] and made.live == [0, 1, 2]


@pytest.mark.parametrize("rules", RULES)
def test_with_the_last_drone_the_mission_is_over(rules: str) -> None:
    made = mission(rules)
    assert [made.lose(i) for i in (2, 0)] == [True, True] and not made.done
    assert made.lose(1) and made.done
    assert made.result.terminated.all() and not made.lose(1)
    refused = made.refuse()
    assert refused is not None and refused.code == "mission_over"


@pytest.mark.parametrize("rules", RULES)
def test_a_restored_mission_has_lost_the_same_drones(
    rules: str,
) -> None:
    made = mission(rules)
    search = made.env.rules.actions.index("search")
    made.command_all([search, search, 1])
    made.advance("hold")
    made.lose(2)
    twin = mission(rules)
    twin.restore(Snapshot.from_bytes(made.snapshot().to_bytes()))
    for each in (made, twin):
        each.command_all([search, 1, 1])
        each.advance("hold")
    assert twin.lost == made.lost == [2] and twin.live == made.live
    assert np.array_equal(twin.history, made.history)
    assert np.array_equal(twin.result.terminated, made.result.terminated)
    assert twin.env.agents == made.env.agents

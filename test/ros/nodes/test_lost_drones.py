# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A drone whose vehicle has dropped out, without ROS."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsse_ros.mission.run.mission import Mission
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.snapshot import Snapshot
from dsse_ros.search.step.constants import NO_ACTION

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
    lossy = mission(rules)
    right = lossy.env.rules.actions.index("right")
    lossy.command_all([right] * 3)
    lossy.advance("hold")
    assert lossy.lose(1) and not lossy.lose(1)
    assert lossy.lost == [1] and lossy.live == [0, 2] and lossy.missing == [0, 2]
    assert lossy.result.terminated.tolist() == [False, True, False]
    refused = lossy.refuse(1)
    assert refused is not None and refused.code == "drone_terminated"
    for _ in range(2):
        lossy.command_all([right] * 3)
        result = lossy.advance("hold")
        assert result.terminated.tolist() == [False, True, False]
        assert result.actions.tolist() == [right, NO_ACTION, right]
        assert result.cells[1].tolist() == [7, 6] and not result.held[1]
        assert result.rewards[1] == 0.0
        assert lossy.env.agents == ["drone0", "drone2"]
    lossy.reset(4)
    assert lossy.lost == [] and lossy.live == [0, 1, 2]


@pytest.mark.parametrize("rules", RULES)
def test_with_the_last_drone_the_mission_is_over(rules: str) -> None:
    lossy = mission(rules)
    assert [lossy.lose(i) for i in (2, 0)] == [True, True] and not lossy.done
    assert lossy.lose(1) and lossy.done
    assert lossy.result.terminated.all() and not lossy.lose(1)
    refused = lossy.refuse()
    assert refused is not None and refused.code == "mission_over"


@pytest.mark.parametrize("rules", RULES)
def test_a_restored_mission_has_lost_the_same_drones(
    rules: str,
) -> None:
    lossy = mission(rules)
    search = lossy.env.rules.actions.index("search")
    lossy.command_all([search, search, 1])
    lossy.advance("hold")
    lossy.lose(2)
    twin = mission(rules)
    twin.restore(Snapshot.from_bytes(lossy.snapshot().to_bytes()))
    for each in (lossy, twin):
        each.command_all([search, 1, 1])
        each.advance("hold")
    assert twin.lost == lossy.lost == [2] and twin.live == lossy.live
    assert np.array_equal(twin.history, lossy.history)
    assert np.array_equal(twin.result.terminated, lossy.result.terminated)
    assert twin.env.agents == lossy.env.agents

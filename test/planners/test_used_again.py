# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A planner that is used for several missions starts again in each."""

from __future__ import annotations

from typing import Any

import pytest

from dsse_ros.planners.play import play
from dsse_ros.planners.registry import make_planner, planner_for
from dsse_ros.search.environments.factories import parallel_env

ON_CELLS = (
    "spiral", "expanding_square", "sweep", "creeping_line", "sector", "greedy", "random",
    "belief", "belief_greedy", "effort_allocation",
)  # fmt: skip


def _played(env: Any, planner: Any, seed: int = 5) -> list[Any]:
    steps = play(env, planner, seed=seed)
    return [[list(map(float, _flat(a))) for a in step.actions.values()] for step in steps]


def _flat(action: Any) -> Any:
    return action if hasattr(action, "__iter__") else [action]


@pytest.mark.parametrize("name", ON_CELLS)
def test_a_second_mission_is_planned_as_the_first_one(name: str) -> None:
    env = parallel_env(
        rules="v1", grid_size=9, num_drones=2, probability_of_detection=1e-9, timestep_limit=25,
        vector=(0.1, 0.0),
    )  # fmt: skip
    planner = planner_for(env, name, seed=1)
    first, other = _played(env, planner), _played(env, planner, seed=6)
    assert len(first) == len(other) > 20
    assert _played(env, planner) == first


def test_coverage_is_planned_again() -> None:
    env = parallel_env(rules="coverage", grid_size=8, num_drones=2, timestep_limit=20)
    planner = planner_for(env, "astar")
    assert _played(env, planner) == _played(env, planner)


@pytest.mark.parametrize("name", ["sweep", "sector", "greedy"])
def test_a_second_mission_in_metres_is_planned_as_the_first_one(name: str) -> None:
    env = parallel_env(rules="flight", grid_size=9, num_drones=2, timestep_limit=15)
    planner = planner_for(env, name, seed=1)
    assert _played(env, planner) == _played(env, planner)


@pytest.mark.parametrize("name", ["spiral", "sweep", "random"])
def test_without_step_numbers_a_jump_of_the_drones_begins_a_mission(name: str) -> None:
    env = parallel_env(
        rules="v1", grid_size=9, num_drones=2, probability_of_detection=1e-9, timestep_limit=13,
    )  # fmt: skip
    planner = make_planner(name, env.rules.actions, seed=1)
    first = _played(env, planner)
    assert max(map(max, abs(env.positions - env.scenario.drones_positions).tolist())) > 1
    assert _played(env, planner) == first

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A drone that is taken out of the search from outside."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.rules import PROFILES

ON_CELLS = [name for name, of in PROFILES.items() if of.actions]


@pytest.mark.parametrize("rules", ON_CELLS)
def test_the_next_step_terminates_it_and_the_others_go_on(rules: str) -> None:
    env = parallel_env(
        rules=rules, grid_size=9, drones_positions=[(1, 1), (4, 4), (7, 1)],
        probability_of_detection=0.0, timestep_limit=12,
    )  # fmt: skip
    env.reset(seed=2)
    search = env.rules.actions.index("search")
    env.step(dict.fromkeys(env.agents, search))
    assert env.withdraw(1) and not env.withdraw(1)
    assert env.agents == ["drone0", "drone1", "drone2"]
    where = env.positions[1].tolist()
    observations, rewards, terminated, truncated, infos = env.step(dict.fromkeys(env.agents, 1))
    assert terminated == {"drone0": False, "drone1": True, "drone2": False}
    assert not any(truncated.values())
    assert rewards["drone1"] == 0.0
    assert observations["drone1"][0].tolist() == where
    assert infos.keys() == observations.keys() == terminated.keys()
    steps = 2
    while env.agents:
        assert env.agents == ["drone0", "drone2"]
        assert [flags.tolist() for flags in env.flags] == [[False, True, False], [False] * 3]
        observations, rewards, *_ = env.step(dict.fromkeys(env.agents, search))
        assert set(observations) == set(rewards) == {"drone0", "drone2"}
        assert env.positions[1].tolist() == where
        steps += 1
    assert steps >= 13 + min(env.rules.time_out_grace, 0) and not env.withdraw(0)
    assert env.flags[0][1] and not env.flags[1][1]


@pytest.mark.parametrize("rules", PROFILES)
def test_with_the_last_one_the_next_step_ends_the_mission(rules: str) -> None:
    env = parallel_env(rules=rules, grid_size=9, num_drones=2)
    env.reset(seed=2)
    assert env.withdraw(0) and env.withdraw(1)
    _, _, terminated, truncated, _ = env.step({})
    assert all(terminated.values()) and len(terminated) == 2 and not any(truncated.values())
    assert env.agents == [] and env.flags[0].all()
    assert env.step({}) == ({}, {}, {}, {}, {})
    env.reset(seed=3)
    assert env.agents == ["drone0", "drone1"] and not env.flags[0].any()


@pytest.mark.parametrize("rules", ON_CELLS)
def test_it_needs_no_action_and_any_is_ignored(rules: str) -> None:
    for action in ({}, {"drone1": 1}, {"drone1": 99}):
        env = parallel_env(rules=rules, grid_size=9, drones_positions=[(1, 1), (4, 4)])
        env.reset(seed=2)
        env.withdraw(1)
        *_, terminated, _, _ = env.step({"drone0": 1} | action)
        assert terminated == {"drone0": False, "drone1": True}
        assert env.positions.tolist() == [[2, 1], [4, 4]]


def test_nobody_collides_with_it_any_more() -> None:
    env = parallel_env(grid_size=9, drones_positions=[(3, 4), (4, 4)], vector=(0, 0))
    env.reset(seed=2)
    env.withdraw(1)
    _, rewards, terminated, *_ = env.step({"drone0": 1})
    assert env.positions.tolist() == [[4, 4], [4, 4]]
    assert rewards == {"drone0": 1.0, "drone1": 0.0} and not terminated["drone0"]


@pytest.mark.parametrize("rules", ON_CELLS)
def test_a_snapshot_before_the_next_step_keeps_it_withdrawn(rules: str) -> None:
    env, twin = (parallel_env(rules=rules, grid_size=9, num_drones=3) for _ in range(2))
    env.reset(seed=2)
    env.withdraw(1)
    twin.restore(env.snapshot())
    assert twin.agents == env.agents
    for each in (env, twin):
        *_, terminated, _, _ = each.step(dict.fromkeys(each.agents, 3))
        assert terminated == {"drone0": False, "drone1": True, "drone2": False}


def test_a_search_without_the_drone_draws_the_same_as_one_in_which_it_only_holds() -> None:
    made = [
        parallel_env(rules="v2", grid_size=9, num_drones=2, timestep_limit=20) for _ in range(2)
    ]
    for env in made:
        env.reset(seed=5)
    made[0].withdraw(1)
    for _ in range(5):
        for env in made:
            env.advance(np.array([0, -1], np.int8))
        assert np.array_equal(made[0].probability, made[1].probability)
        assert np.array_equal(made[0].world.persons, made[1].world.persons)


@pytest.mark.parametrize("drone", [-1, 2, 1.0, "drone0", None, True, [0, 1]])
def test_a_drone_that_is_none_is_refused(drone: Any) -> None:
    env = parallel_env(num_drones=2)
    env.reset(seed=2)
    with pytest.raises(FieldError, match="^drone must be .* got "):
        env.withdraw(drone)
    assert env.agents == ["drone0", "drone1"]

# SPDX-License-Identifier: Apache-2.0
"""A drone that is taken out of the search from outside."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsse_ros.search import FieldError, parallel_env
from dsse_ros.search.rules import PROFILES


@pytest.mark.parametrize("rules", PROFILES)
def test_the_others_go_on_as_if_it_had_been_terminated(rules: str) -> None:
    env = parallel_env(
        rules=rules, grid_size=9, drones_positions=[(1, 1), (4, 4), (7, 1)],
        probability_of_detection=0.0, timestep_limit=12,
    )  # fmt: skip
    env.reset(seed=2)
    search = env.rules.actions.index("search")
    env.step(dict.fromkeys(env.agents, search))
    assert env.withdraw(1) and not env.withdraw(1)
    assert env.agents == ["drone0", "drone2"]
    where = env.positions[1].tolist()
    steps = 0
    while env.agents:
        observations, rewards, *_ = env.step(dict.fromkeys(env.agents, search))
        assert set(observations) == set(rewards) == {"drone0", "drone2"}
        assert env.positions[1].tolist() == where
        steps += 1
    assert steps >= 11 and not env.withdraw(0)


@pytest.mark.parametrize("rules", PROFILES)
def test_the_last_one_ends_the_mission_and_a_reset_starts_the_next(rules: str) -> None:
    env = parallel_env(rules=rules, grid_size=9, num_drones=2)
    env.reset(seed=2)
    assert env.withdraw(0) and env.withdraw(1)
    assert env.agents == [] and env.flags[0].all()
    assert env.step({}) == ({}, {}, {}, {}, {})
    env.reset(seed=3)
    assert env.agents == ["drone0", "drone1"] and not env.flags[0].any()


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
    with pytest.raises(FieldError, match="^drone: .* not allowed"):
        env.withdraw(drone)
    assert env.agents == ["drone0", "drone1"]

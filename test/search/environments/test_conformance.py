# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""PettingZoo's own conformance tests, passed without a warning, and what it asks for in prose."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env
from pettingzoo import AECEnv, ParallelEnv
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, render_test, seed_test
from pettingzoo.test.state_test import state_test
from pettingzoo.utils import BaseWrapper
from play import started

from dsse_ros.search.environments import aec
from dsse_ros.search.environments.aec import aec_env, raw_env
from dsse_ros.search.environments.factories import parallel_env

pytestmark = pytest.mark.filterwarnings("error")

swarms = pytest.mark.parametrize("num_drones", [1, 8, 100])
turn_based = pytest.mark.parametrize("make", [aec_env, raw_env])


def swarm(num_drones: int) -> dict[str, Any]:
    return {"grid_size": 20, "num_drones": num_drones}


@swarms
def test_the_parallel_environment_conforms(num_drones: int) -> None:
    parallel_api_test(parallel_env(**swarm(num_drones)))


@swarms
@turn_based
def test_the_turn_based_environments_conform(make: Any, num_drones: int) -> None:
    api_test(make(**swarm(num_drones)))


@swarms
def test_equal_seeds_pass_for_equal(num_drones: int) -> None:
    parallel_seed_test(lambda: parallel_env(**swarm(num_drones)))
    seed_test(lambda: aec_env(**swarm(num_drones)), num_cycles=50)


@pytest.mark.slow
@swarms
def test_every_render_mode_conforms(num_drones: int) -> None:
    render_test(lambda render_mode: aec_env(render_mode=render_mode, **swarm(num_drones)))


@swarms
def test_states_conform(num_drones: int) -> None:
    state_test(aec_env(**swarm(num_drones)), parallel_env(**swarm(num_drones)))


def test_the_environments_have_the_names_of_pettingzoo_s_own() -> None:
    made = [make(num_drones=2) for make in (aec.env, aec.raw_env, parallel_env)]
    assert [isinstance(env, AECEnv) for env in made] == [True, True, False]
    # A raw environment has no wrapper, so that a user's own wrappers are the only ones.
    assert not isinstance(made[1], BaseWrapper)
    of_env, layers = made[0], 0
    while isinstance(of_env, BaseWrapper):
        of_env, layers = of_env.env, layers + 1
    assert layers == 2
    api_test(made[0])


def test_agents_are_numbered_from_zero_and_spaces_are_always_the_same_objects() -> None:
    env = parallel_env(num_drones=3)
    assert isinstance(env, ParallelEnv)
    assert env.possible_agents == ["drone0", "drone1", "drone2"]
    assert env.max_num_agents == 3
    for agent in env.possible_agents:
        assert env.observation_space(agent) is env.observation_space(agent)
        assert env.action_space(agent) is env.action_space(agent)
        assert env.action_space(agent) == spaces.Discrete(5)
        assert env.observation_space(agent) == spaces.Tuple(
            (spaces.MultiDiscrete([8, 8]), spaces.Box(0, 1, (8, 8), np.float32))
        )
    env.reset(seed=0)
    assert env.agents == env.possible_agents
    assert env.num_agents == 3
    assert env.unwrapped is env


def test_agents_sample_actions_of_their_own() -> None:
    env = parallel_env(num_drones=2, grid_size=5)
    for i, agent in enumerate(env.possible_agents):
        env.action_space(agent).seed(i)
    first, second = (
        [int(env.action_space(agent).sample()) for _ in range(50)] for agent in env.possible_agents
    )
    assert first != second


def test_metadata_names_the_environment_and_its_render_modes() -> None:
    assert parallel_env().metadata["render_modes"] == ["ansi", "rgb_array", "human"]
    assert parallel_env().metadata["name"]
    assert parallel_env().metadata["is_parallelizable"] is True


def test_the_turn_based_environment_gives_the_parallel_one_s_observations_flattened() -> None:
    fields: dict[str, Any] = {"num_drones": 2, "grid_size": 6, "sigma": 2.0}
    turns, env = aec_env(**fields), started(seed=3, **fields)
    turns.reset(seed=3)
    assert isinstance(turns, AECEnv)
    assert turns.possible_agents == ["drone_0", "drone_1"]
    for _ in range(4):
        for i, agent in enumerate(list(turns.agents)):
            assert turns.agent_selection == agent
            flat, *_, info = turns.last()
            space = env.observation_space(f"drone{i}")
            position, probability = spaces.unflatten(space, flat)
            np.testing.assert_array_equal(position, env.positions[i])
            np.testing.assert_array_equal(probability, env.probability)
            np.testing.assert_array_equal(info["action_mask"], env.action_masks()[i])
            turns.step(3)
        _, rewards, *_ = env.step(dict.fromkeys(env.agents, 3))
        assert list(turns.rewards.values()) == list(rewards.values())


def test_the_turn_based_environment_pays_what_the_parallel_one_pays() -> None:
    fields: dict[str, Any] = {"num_drones": 6, "grid_size": 5, "timestep_limit": 20}
    for seed in range(10):
        generator = np.random.default_rng(seed)
        script = generator.choice(5, (21, 6), p=[0.1, 0.1, 0.1, 0.1, 0.6])
        env, paid = started(seed, **fields), dict.fromkeys(range(6), 0.0)
        for actions in script:
            _, rewards, *_ = env.step({agent: int(actions[int(agent[5:])]) for agent in env.agents})
            for agent, reward in rewards.items():
                paid[int(agent[5:])] += reward
        turns, returns = aec_env(**fields), dict.fromkeys(range(6), 0.0)
        turns.reset(seed=seed)
        turn = dict.fromkeys(range(6), 0)
        for agent in turns.agent_iter():
            number = int(agent[6:])
            _, reward, terminated, truncated, _ = turns.last()
            if terminated or truncated:
                returns[number] += reward
                turns.step(None)
            else:
                # What was earned before this agent's turn adds up until it is asked for.
                returns[number] += reward
                turns.step(int(script[turn[number], number]))
                turn[number] += 1
        assert returns == pytest.approx(paid)


def test_the_checked_environment_refuses_use_out_of_order_and_actions_out_of_bounds() -> None:
    env = aec_env()
    with pytest.raises((AssertionError, AttributeError)):
        env.step(0)
    env.reset(seed=0)
    with pytest.raises(AssertionError):
        env.step(5)


class _OneDrone(gymnasium.Env[Any, Any]):
    """A search with one drone as a Gymnasium environment."""

    def __init__(self, rules: str) -> None:
        self.env = parallel_env(rules=rules, grid_size=6, num_drones=1)
        self.observation_space = self.env.observation_space("drone0")
        self.action_space = self.env.action_space("drone0")

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        observations, infos = self.env.reset(seed=seed, options=options)
        return observations["drone0"], infos["drone0"]

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        return tuple(of_all["drone0"] for of_all in self.env.step({"drone0": action}))  # type: ignore[return-value]


@pytest.mark.parametrize("rules", ["paper", "v2", "sea", "coverage", "flight"])
def test_one_drone_passes_the_checks_of_gymnasium(rules: str) -> None:
    check_env(_OneDrone(rules), skip_render_check=True)


def test_masks_of_drones_in_one_cell_are_arrays_of_their_own() -> None:
    env = parallel_env(rules="v2", grid_size=6, num_drones=2)
    _, infos = env.reset(seed=1, options={"drones_positions": [(2, 2), (2, 2)]})
    infos["drone0"]["action_mask"][:] = 0
    assert infos["drone1"]["action_mask"].all()
    *_, infos = env.step({"drone0": 8, "drone1": 8})
    assert infos["drone0"]["action_mask"].all()

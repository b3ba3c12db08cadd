# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scripts for DSSE 0.1.13 find what they know."""

from __future__ import annotations

import pytest

from dsse_ros.compat.v1 import DroneSwarmSearch


def test_a_mission_has_the_published_shapes() -> None:
    env = DroneSwarmSearch(grid_size=9, n_drones=2, vector=(0.5, 0.5), disperse_constant=5)
    observations = env.reset(drones_positions=[(4, 4), (8, 8)], seed=3)
    assert [list(each) for each in observations.values()] == [["observation"]] * 2
    cell, probability = observations["drone0"]["observation"]
    assert cell == (4, 4) and probability.shape == (9, 9)
    observations, rewards, terminated, truncated, infos = env.step({"drone0": 0, "drone1": 4})
    assert observations["drone0"]["observation"][0] == env.agents_positions["drone0"] == (3, 4)
    assert list(rewards) == ["drone0", "drone1", "total_reward"]
    assert rewards["drone0"] == 1 and rewards["total_reward"] == rewards["drone1"] + 1
    assert terminated == truncated == {"drone0": False, "drone1": False}
    assert infos == {"Found": False}
    assert env.action_space("drone0") == [0, 1, 2, 3, 4]
    assert env.rewards_sum["total"] == rewards["total_reward"]


def test_leaving_the_grid_ends_the_mission_and_later_steps_change_nothing() -> None:
    env = DroneSwarmSearch(n_drones=2)
    env.reset()
    _, rewards, terminated, _, _ = env.step({"drone0": 0, "drone1": 3})
    assert rewards["drone0"] == -100000 and terminated["drone0"]
    positions, total = dict(env.agents_positions), env.rewards_sum["total"]
    env.step({"drone0": 1, "drone1": 1})
    assert (env.agents_positions, env.rewards_sum["total"]) == (positions, total)


def test_rewards_that_were_replaced_count_from_the_next_step() -> None:
    env = DroneSwarmSearch()
    env.reward_scheme["default"] = 7
    env.reset()
    assert env.step({"drone0": 1})[1]["drone0"] == 7


def test_what_a_script_sets_counts_as_in_the_package() -> None:
    env = DroneSwarmSearch(grid_size=6, n_drones=2, timestep_limit=9)
    env.reset(seed=1, drones_positions=[(1, 1), (4, 4)])
    env.step({"drone0": 1, "drone1": 0})
    env.reward_scheme.update(default=2, search_and_find=50)
    assert env.step({"drone0": 1, "drone1": 0})[1] == {"drone0": 2, "drone1": 2, "total_reward": 4}
    env.agents = ["drone1"]
    positions = dict(env.agents_positions)
    _, rewards, *_ = env.step({"drone1": 3})
    assert rewards == {"drone1": 2, "total_reward": 2}
    assert env.agents_positions["drone0"] == positions["drone0"]
    env.agents = ["drone0", "drone1"]
    env.person_x, env.person_y = env.agents_positions["drone1"]
    env.timestep = 3
    _, rewards, *_, infos = env.step({"drone0": 2, "drone1": 4})
    assert infos["Found"] and rewards["drone1"] == 50 + 50 * (1 - 3 / 9)
    env.reset(drones_positions=[(1, 1), (4, 4)])
    env.timestep_limit, env.timestep, env.rewards_sum["drone0"] = 3, 4, 11
    # Out of time, a drone gives back what it has earned, and pays.
    assert env.step({"drone0": 1, "drone1": 0})[1]["drone0"] == -11 - 100000


def test_what_a_script_sets_counts_from_the_next_reset() -> None:
    env = DroneSwarmSearch(grid_size=6)
    env.reset()
    env.grid_size, env.person_initial_position, env.disperse_constant = 9, [7, 2], 1.5
    with pytest.raises(ValueError, match=r"^grid_size must be 6 until the next reset, got 9$"):
        env.step({"drone0": 1})
    env.reset(vector=(0, 0))
    matrix = env.probability_matrix.get_matrix()
    assert matrix.shape == (9, 9) and env.probability_matrix.supposed_position == (2, 7)
    assert matrix[2, 7] == matrix.max() and matrix[2, 8] < 0.9 * matrix[2, 7]


def test_a_cell_that_a_script_assigns_moves_the_drone() -> None:
    env = DroneSwarmSearch()
    env.reset()
    env.agents_positions["drone0"] = [3, 4]
    assert env.step({"drone0": 1})[0]["drone0"]["observation"][0] == (4, 4)


def test_a_missing_action_is_named() -> None:
    env = DroneSwarmSearch(n_drones=2)
    with pytest.raises(ValueError, match="reset"):
        env.step({})
    env.reset()
    with pytest.raises(ValueError, match="Missing action for drone1"):
        env.step({"drone0": 1})
    with pytest.raises(ValueError, match=r"^n_drones must .*, got 50$"):
        DroneSwarmSearch(n_drones=50)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scripts for DSSE 1.1.9 find what they know: names, episodes, errors."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.compat import Actions, DroneSwarmSearch, Reward

DATA = Path(__file__).parent.parent / "oracles" / "data" / "v2_episodes.json"
EPISODES: list[dict[str, Any]] = json.loads(DATA.read_text(encoding="utf-8"))["episodes"]


def env_of(episode: dict[str, Any]) -> DroneSwarmSearch:
    return DroneSwarmSearch(
        grid_size=episode["grid"],
        vector=episode["vector"],
        person_initial_position=episode["person_initial_position"],
        person_amount=episode["person_amount"],
        probability_of_detection=episode["probability_of_detection"],
        timestep_limit=episode["timestep_limit"],
        drone_amount=len(episode["options"]["drones_positions"]),
    )


@pytest.mark.parametrize("episode", EPISODES, ids=lambda episode: str(episode["name"]))
def test_an_episode_runs_as_on_the_package(episode: dict[str, Any]) -> None:
    env = env_of(episode)
    env.reset(seed=1, options=episode["options"])
    agents = list(env.possible_agents)
    for step in episode["steps"]:
        for person in env.get_persons():
            person.x, person.y = step["persons"][person.index]
        assert env.timestep == step["t"]
        actions = dict(zip(agents, step["actions"], strict=True))
        if "error" in step:
            with pytest.raises(ValueError, match="Invalid action for drone1"):
                env.step(actions)
            return
        observations, rewards, terminated, truncated, infos = env.step(actions)
        assert list(rewards.values()) == step["rewards"]
        assert list(terminated.values()) == step["terminated"]
        assert list(truncated.values()) == step["truncated"]
        assert [info["Found"] for info in infos.values()] == step["found"]
        assert [list(cell) for cell in env.agents_positions] == step["positions"]
        assert all(observations[a][0] == env.agents_positions[agents.index(a)] for a in rewards)
        assert len(env.agents) == step["agents_left"]


def play(seed: int | None) -> list[Any]:
    env = DroneSwarmSearch(grid_size=8, vector=(1.5, 1.0), drone_amount=2, person_amount=3)
    env.reset(seed=seed)
    persons = []
    for _ in range(30):
        if env.agents:
            env.step(dict.fromkeys(env.agents, Actions.SEARCH.value))
        persons.append(sorted(person.get_position() for person in env.get_persons()))
    return persons


def test_a_seed_counts() -> None:
    assert play(3) == play(3) != play(4)


def test_rewards_that_were_replaced_count_from_the_next_step() -> None:
    env = DroneSwarmSearch(grid_size=3, timestep_limit=2)
    env.reset()
    env.unwrapped.reward_scheme = Reward(-1.0, -5.0, -7.0, 0, 0, 1)
    assert env.step({"drone0": Actions.LEFT.value})[1] == {"drone0": -5.0}
    assert env.step({"drone0": Actions.RIGHT.value})[1] == {"drone0": -1.0}
    assert env.step({"drone0": Actions.RIGHT.value})[1] == {"drone0": -7.0}
    # As in the package, without the steps after the limit.
    assert env.rewards_sum == {"drone0": -6.0, "total": 0}


def test_a_search_that_finds_nobody_earns_the_default() -> None:
    class Cheap(DroneSwarmSearch):
        reward_scheme = Reward(-1.0, -5.0, -7.0, 0, 0, 1)

    env = Cheap(grid_size=9, vector=(0, 0), person_initial_position=(8, 8), dispersion_inc=0)
    env.reset()
    assert env.step({"drone0": Actions.SEARCH.value})[1] == {"drone0": -1.0}


def test_the_published_names_are_there() -> None:
    env = DroneSwarmSearch(drone_amount=2, pre_render_time=3, vector=(0.5, 0.2))
    assert env.agents_positions == [(None, None)] * 2 and env.probability_matrix is None
    env.reset(options={"vector": (0.1, 0.3), "person_pod_multipliers": [0.5]})
    assert env.vector == (0.1, 0.3)
    env.reset()
    assert env.vector == (0.1, 0.3)
    assert env.get_agents() == env.possible_agents == ["drone0", "drone1"]
    assert env.pre_render_steps == 14 and env.time_step_relation == 13.0
    assert env.agents_positions == [(0, 0), (1, 0)]
    assert env.probability_matrix is not None
    assert env.probability_matrix.get_matrix().sum() == pytest.approx(1.0)
    assert env.action_space("drone0").n == len(Actions) == 9
    assert (env.drone.amount, env.drone.speed, env.drone.pod) == (2, 10, 1.0)
    assert not env.is_valid_position((20, 0)) and isinstance(env.render(), str)
    env.close()


def test_a_script_may_write_into_what_it_observed() -> None:
    env, other = (DroneSwarmSearch(grid_size=6) for _ in range(2))
    observed, expected = env.reset(seed=1)[0], other.reset(seed=1)[0]
    observed["drone0"][1][:] = 0
    observed, expected = env.step({"drone0": 1})[0], other.step({"drone0": 1})[0]
    np.testing.assert_array_equal(observed["drone0"][1], expected["drone0"][1])


def test_a_cell_that_a_script_assigns_moves_the_drone() -> None:
    env = DroneSwarmSearch(grid_size=9, drone_amount=2, probability_of_detection=0)
    env.reset()
    positions = env.agents_positions
    positions[1] = np.array([6, 5])
    env.step({"drone0": Actions.SEARCH.value, "drone1": Actions.LEFT.value})
    assert positions is env.agents_positions and positions == [(0, 0), (5, 5)]
    env.agents_positions = [(8, 8), (0, 0)]
    observations, rewards, *_ = env.step(dict.fromkeys(env.agents, Actions.UP.value))
    assert [observations[agent][0] for agent in rewards] == [(8, 7), (0, 0)]


@pytest.mark.parametrize("cells", [[(0, 9)], [(0, -1)], [(0, 0), (1, 1)], [(None, None)], [3]])
def test_a_cell_that_cannot_be_assigned_is_refused(cells: Any) -> None:
    env = DroneSwarmSearch(grid_size=9)
    env.reset()
    env.agents_positions = cells
    with pytest.raises(ValueError, match=r"^agents_positions must .*, got "):
        env.step({"drone0": 1})
    assert env.timestep == 0 and env.positions.tolist() == [[0, 0]]


def test_a_copy_goes_its_own_way() -> None:
    env = DroneSwarmSearch(grid_size=9, drone_amount=2, person_amount=2)
    env.reset(seed=4)
    env.step({"drone0": 1, "drone1": 1})
    twin = copy.deepcopy(env)
    for person in twin.get_persons():
        person.set_mult(0)
    actions = {"drone0": Actions.SEARCH.value, "drone1": 1}
    for each in (env, twin):
        for person in each.get_persons():
            person.x, person.y = each.agents_positions[0]
    assert env.step(actions)[1]["drone0"] > 1.0 and len(env.get_persons()) == 1
    assert twin.step(actions)[1]["drone0"] == 0.0 and len(twin.get_persons()) == 2


def test_drones_that_start_in_the_same_cell_are_refused() -> None:
    env = DroneSwarmSearch(grid_size=9, drone_amount=2)
    env.reset(options={"drones_positions": [(3, 3), (5, 5)]})
    with pytest.raises(ValueError, match=r"^drones_positions must be different cells, got "):
        env.reset(options={"drones_positions": [(4, 4), (4, 4)]})
    assert env.positions.tolist() == [[3, 3], [5, 5]]


def test_a_subclass_can_change_the_observations() -> None:
    class Shifted(DroneSwarmSearch):
        def create_observations(self) -> dict[str, Any]:
            observations = super().create_observations()
            assert observations["drone0"][0] == self.agents_positions[0]
            return {agent: cell[0] + 100 for agent, (cell, _) in observations.items()}

    env = Shifted(grid_size=9)
    assert env.reset()[0] == {"drone0": 100}
    assert env.step({"drone0": Actions.RIGHT.value})[0] == {"drone0": 101}


@pytest.mark.parametrize("inherited", [False, True])
def test_a_subclass_whose_method_would_never_be_called_is_refused(inherited: bool) -> None:
    methods = {"move_drone": lambda self, position, action: position}
    mixin = type("Mixin", (), methods)
    with pytest.raises(TypeError, match="^Windy must not override move_drone"):
        if inherited:
            type("Windy", (mixin, DroneSwarmSearch), {})
        else:
            type("Windy", (DroneSwarmSearch,), methods)


@pytest.mark.parametrize(
    "arguments",
    [
        {"drone_amount": 0},
        {"drone_amount": 1.5},
        {"drone_amount": 50, "grid_size": 7},
        {"render_mode": "loud"},
        {"fps": 0},
        {"person_amount": 0},
        {"dispersion_start": 0},
        {"person_initial_position": (20, 0)},
    ],
)
def test_an_argument_that_is_not_allowed_is_named_as_the_script_knows_it(
    arguments: dict[str, Any],
) -> None:
    with pytest.raises(ValueError, match=rf"^{next(iter(arguments))} must .*, got "):
        DroneSwarmSearch(**arguments)


def test_a_step_without_a_reset_or_an_action_is_refused() -> None:
    env = DroneSwarmSearch(drone_amount=2)
    with pytest.raises(ValueError, match="reset"):
        env.step({})
    env.reset()
    with pytest.raises(ValueError, match="Missing action for drone1"):
        env.step({"drone0": 1})
    assert env.timestep == 0

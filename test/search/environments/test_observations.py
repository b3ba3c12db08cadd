# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What agents are given, what they may do with it, and the stable face of the environment."""

from __future__ import annotations

import inspect
import re
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from hypothesis import given, settings
from hypothesis import strategies as st
from play import missions, person_cells, put_person, some_actions, started, step

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.agents import RESET_FIRST
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.plain import SEARCH, moved, on_grid
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.probable_cells import datum_of, most_probable


def test_the_public_arguments_keep_their_names_and_are_keywords() -> None:
    parameters = inspect.signature(parallel_env).parameters
    assert next(iter(parameters)) == "scenario"
    assert parameters["scenario"].default is None
    assert parameters["rules"].default == "auto"
    for name in ("rules", "render_mode", "observe"):
        assert parameters[name].kind is inspect.Parameter.KEYWORD_ONLY


def test_every_argument_arrives_in_the_scenario() -> None:
    fields: dict[str, Any] = {
        "grid_size": (9, 7),
        "num_drones": 3,
        "vector": (0.25, -0.5),
        "person_initial_position": (4, 5),
        "person_amount": 2,
        "sigma": 1.5,
        "timestep_limit": 77,
        "cell_size": 50.0,
        "drone_speed": 25.0,
        "origin_lat": -10.0,
    }
    scenario = parallel_env(**fields).scenario
    assert {name: getattr(scenario, name) for name in fields} == fields
    assert scenario.step_duration_s == 2


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(missions(max_drones=12), st.integers(0, 99))
def test_observations_lie_in_their_spaces_and_have_their_types(
    fields: dict[str, Any], seed: int
) -> None:
    env = parallel_env(**fields)
    generator = np.random.default_rng(seed)
    observations, infos = env.reset(seed=seed)
    for _ in range(15):
        for agent, (position, probability) in observations.items():
            assert env.observation_space(agent).contains((position, probability))
            assert position.dtype == np.int64 and position.shape == (2,)
            assert probability.dtype == np.float32
            mask = infos[agent]["action_mask"]
            assert mask.dtype == np.int8 and mask.shape == (5,)
            assert isinstance(infos[agent]["Found"], bool)
        assert env.state_space.contains(env.state())
        if not env.agents:
            break
        agents = list(env.agents)
        observations, rewards, terminated, truncated, infos = env.step(some_actions(env, generator))
        for values in (observations, rewards, terminated, truncated, infos):
            assert list(values) == agents
        assert all(type(reward) is float for reward in rewards.values())
        assert all(type(flag) is bool for flag in [*terminated.values(), *truncated.values()])


def test_all_agents_share_one_map_that_nobody_can_write_to() -> None:
    env = parallel_env(num_drones=4)
    observations, _ = env.reset(seed=0)
    for _ in range(3):
        maps = [probability for _, probability in observations.values()]
        assert all(probability is maps[0] for probability in maps)
        assert not maps[0].flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            maps[0][0, 0] = 1
        observations, *_ = step(env, *[SEARCH] * 4)


def test_old_observations_stay_what_they_were() -> None:
    env = parallel_env(
        drones_positions=[(0, 0), (4, 4)], person_initial_position=(7, 7), vector=(0, 0)
    )
    observations, infos = env.reset(seed=0)
    kept = []
    for number in range(6):
        kept.append((observations, infos, repr(observations), repr(infos), env.state()))
        observations, *_, infos = step(env, 1 if number < 3 else 3, SEARCH)
    env.reset(seed=1)
    for old_observations, old_infos, text, info_text, _ in kept:
        assert repr(old_observations) == text
        assert repr(old_infos) == info_text
    assert len({text for _, _, text, _, _ in kept}) == len(kept)
    assert len({state.tobytes() for *_, state in kept}) == len(kept)


def test_what_agents_do_to_their_observations_does_not_reach_the_world() -> None:
    env, untouched = (started(num_drones=2, grid_size=4, sigma=1) for _ in range(2))
    for actions in ((3, 3), (3, 3), (1, 1)):
        observations, *_, infos = step(env, *actions)
        step(untouched, *actions)
        for agent, (position, _) in observations.items():
            position[:] = 99
            with suppress(ValueError):
                infos[agent]["action_mask"][:] = 0
        env.positions[:] = 99
        env.action_masks()[:] = 0
        env.state()[:] = 99
    assert env.world.state_bytes() == untouched.world.state_bytes()
    np.testing.assert_array_equal(env.action_masks(), untouched.action_masks())
    assert env.positions.tolist() == untouched.positions.tolist()


@settings(deadline=None, max_examples=20)
@given(st.integers(1, 6))
def test_the_mask_forbids_exactly_what_leaves_the_grid(size: int) -> None:
    env = parallel_env(grid_size=size)
    for cell in np.ndindex(size, size):
        for action in range(5):
            _, infos = env.reset(options={"drones_positions": [cell]})
            allowed = infos["drone0"]["action_mask"][action]
            assert allowed == on_grid(moved((cell[0], cell[1]), action), (size, size))
            np.testing.assert_array_equal(infos["drone0"]["action_mask"], env.action_masks()[0])
            put_person(env, (0, 0) if cell != (0, 0) else (size - 1, size - 1))
            _, rewards, *_ = step(env, action)
            assert (rewards["drone0"] == -100000) == (not allowed)


def test_only_live_agents_are_given_anything_and_need_to_act() -> None:
    env = started(grid_size=4, drones_positions=[(0, 0), (1, 1), (3, 3)], vector=(0, 0))
    step(env, 0, SEARCH, SEARCH)
    put_person(env, (0, 0))
    actions: dict[str, Any] = {"drone2": SEARCH, "drone0": 77, "drone1": SEARCH, "you": None}
    results = env.step(actions)
    for values in results:
        assert list(values) == ["drone1", "drone2"]


@pytest.mark.parametrize("number", [3, np.int64(3), np.int8(3), np.uint8(3), np.array(3)])
def test_any_integer_type_is_an_action(number: Any) -> None:
    env = started(drones_positions=[(3, 3)])
    env.step({"drone0": number})
    assert env.positions.tolist() == [[3, 4]]


def test_the_order_of_the_actions_given_does_not_matter() -> None:
    one, other = (started(drones_positions=[(2, 2), (5, 5)]) for _ in range(2))
    one.step({"drone0": 0, "drone1": 3})
    other.step({"drone1": 3, "drone0": 0})
    assert one.world.state_bytes() == other.world.state_bytes()


@settings(deadline=None, max_examples=25)
@given(missions(), st.integers(0, 99))
def test_the_state_shows_map_drones_persons_and_time(fields: dict[str, Any], seed: int) -> None:
    env = started(seed, **fields)
    generator = np.random.default_rng(seed)
    shape = fields["grid_size"][::-1]
    for done in range(12):
        state = env.state()
        assert state.dtype == np.float32 and state.shape == (4, *shape)
        np.testing.assert_array_equal(state[0], env.probability)
        drones, persons = np.zeros((2, *shape))
        for agent in env.agents:
            col, row = env.positions[env.possible_agents.index(agent)]
            drones[row, col] += 1
        found = env.world.persons["found"][0]
        for i, (col, row) in enumerate(person_cells(env)):
            persons[row, col] += not found[i]
        np.testing.assert_array_equal(state[1], drones)
        np.testing.assert_array_equal(state[2], persons)
        np.testing.assert_allclose(state[3], done / fields["timestep_limit"], rtol=1e-6)
        if not env.agents:
            break
        env.step(some_actions(env, generator))


def test_the_state_of_many_persons_in_one_cell_lies_in_its_space() -> None:
    env = started(person_amount=30)
    assert env.state()[2].max() == 30
    assert env.state_space.contains(env.state())


@pytest.mark.parametrize("action", range(4))
def test_the_state_leaves_out_a_drone_that_flew_off_the_grid(action: int) -> None:
    corner = (0, 0) if action in (0, 2) else (2, 2)
    env = started(rules="v1", grid_size=3, drones_positions=[corner])
    env.step({"drone0": action})
    assert env.state() in env.state_space and not env.state()[1].any()


def test_the_state_lies_in_its_space_however_long_the_time_out_is() -> None:
    env = started(grid_size=5, timestep_limit=1, time_out_grace=10, sigma=5)
    while env.agents:
        at_west_edge = env.positions[0, 0] == 0
        env.step({"drone0": int(at_west_edge)})
        assert env.state() in env.state_space


def test_flags_that_were_handed_out_stay_and_reach_no_further() -> None:
    env = started(rules="v1", grid_size=3)
    terminated, truncated = env.flags
    terminated[:] = truncated[:] = True
    assert not env.flags[0].any() and not env.flags[1].any()


def test_a_drone_that_holds_stays_and_is_paid_like_a_mover() -> None:
    env = started(drones_positions=[(3, 3), (5, 5)], person_initial_position=(3, 3))
    env.advance(np.array([NO_ACTION, 0], np.int8))
    assert env.world.rewards.tolist() == [[1, 1]]
    assert env.positions.tolist() == [[3, 3], [4, 5]]
    assert not env.world.persons["found"].any()


def test_advancing_is_stepping_without_observations() -> None:
    one, other = (started(num_drones=3, grid_size=4, timestep_limit=9) for _ in range(2))
    generator = np.random.default_rng(0)
    while one.agents:
        actions = some_actions(one, generator)
        joint = np.array([actions.get(agent, 0) for agent in one.possible_agents], np.int8)
        _, rewards, *_ = one.step(actions)
        agents = list(other.agents)
        other.advance(joint)
        assert one.agents == other.agents
        assert one.world.state_bytes() == other.world.state_bytes()
        assert list(rewards) == agents
        assert list(rewards.values()) == [
            other.world.rewards[0, other.possible_agents.index(agent)] for agent in agents
        ]


def test_an_environment_is_reset_before_it_is_looked_at() -> None:
    env = parallel_env(num_drones=2, render_mode="ansi")
    assert env.agents == []
    for look in (env.state, env.render):
        with pytest.raises(ResetNeeded):
            look()
    env.reset()
    assert env.state_space.contains(env.state())
    assert isinstance(env.render(), str)
    env.close()


def test_an_environment_is_reset_before_its_first_step() -> None:
    env = parallel_env(num_drones=2, timestep_limit=3)
    held = np.full(2, NO_ACTION, np.int8)
    for begin in (lambda: env.step({}), lambda: env.step({"drone0": 1}), lambda: env.advance(held)):
        with pytest.raises(ResetNeeded, match=re.escape(RESET_FIRST)):
            begin()
    env.reset(seed=0)
    while env.agents:
        env.step(dict.fromkeys(env.agents, 4))
    # As in PettingZoo, a mission that is over has nothing to report.
    assert env.step({}) == ({}, {}, {}, {}, {})


@pytest.mark.parametrize(
    "options",
    [
        {"drones_positions": [(0, 0)]},
        {"drones_positions": [(0, 0), (8, 0)]},
        {"drones_positions": [(0, 0), (0, 0)]},
        {"drones_positions": []},
        {"drones_positions": "00"},
        {"vector": (float("nan"), 0)},
        {"vector": 1},
        {"person_initial_position": (8, 0)},
        {"person_initial_position": (-1, 0)},
        {"person_initial_position": (0.5, 0)},
        {"person_pod_multipliers": [1, 1]},
        {"drone_positions": [(0, 0), (1, 0)]},
        {"vectr": (1, 1)},
        {"person_inital_position": (1, 1)},
        {"vectors": (1, 1)},
        {"person": (1, 1)},
        {"opponents": "none"},
        {"options": 1, "wind": 3},
        {5: (1, 1)},
    ],
)
def test_a_wrong_reset_option_is_refused_and_the_mission_goes_on(options: dict[str, Any]) -> None:
    env = started(num_drones=2, sigma=2)
    step(env, 3, 3)
    before, agents = env.world.state_bytes(), list(env.agents)
    with pytest.raises(FieldError) as caught:
        env.reset(seed=9, options=options)
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    assert str(list(options)[-1]) in message
    assert env.world.state_bytes() == before and env.agents == agents
    step(env, 3, 3)


def test_the_option_of_pettingzoo_s_tests_is_ignored() -> None:
    env, other = parallel_env(), parallel_env()
    env.reset(seed=1, options={"options": 1})
    other.reset(seed=1)
    assert env.world.state_bytes() == other.world.state_bytes()


def test_a_field_of_none_is_left_as_it_is() -> None:
    given = parallel_env(collision=None, sigma=None, noop_actions=None)  # type: ignore[arg-type]
    assert (given.scenario, given.rules) == (parallel_env().scenario, parallel_env().rules)


def test_an_option_of_none_is_no_option() -> None:
    env, other = parallel_env(), parallel_env()
    env.reset(seed=1, options={"vector": None, "drones_positions": None})
    other.reset(seed=1, options={})
    assert env.world.state_bytes() == other.world.state_bytes()


@pytest.mark.slow
@settings(deadline=None)
@given(st.data())
def test_the_most_probable_cells_are_the_end_of_a_stable_sort(data: st.DataObject) -> None:
    size = data.draw(st.integers(1, 12))
    count = data.draw(st.integers(1, size * size))
    values = st.sampled_from([0.0, 0.125, 0.25, 0.5])
    drawn = data.draw(st.lists(values, min_size=size * size, max_size=size * size))
    probability = np.array(drawn, np.float32).reshape(size, size)
    ordered = sorted(
        ((col, row) for row in range(size) for col in range(size)),
        key=lambda cell: probability[cell[1], cell[0]],
    )
    assert most_probable(probability, count) == ordered[-count:]
    assert datum_of(probability) == ordered[-1]


def test_an_unknown_probability_is_the_worst() -> None:
    probability = np.array([[np.nan, 0.1], [0.3, np.nan]], np.float32)
    assert most_probable(probability, 2) == [(1, 0), (0, 1)]
    assert most_probable(probability, 4)[2:] == [(1, 0), (0, 1)]
    assert datum_of(probability) == (0, 1)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search in metres: its environments, and what they refuse."""

from __future__ import annotations

import pickle
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pettingzoo.test import api_test, parallel_api_test

from dsse_ros.base.fields import FieldError
from dsse_ros.search.environments.aec import aec_env
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.search.environments.joint_vector_env import JointVectorEnv
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.waypoints import Waypoints
from dsse_ros.world.scenario.rules import profile

PLACE: dict[str, Any] = {
    "rules": "flight", "person_motion": "constant_drift", "grid_size": 20, "particles": 500,
    "drones_positions": ((9, 9), (10, 10), (3, 3)), "vector": (0.3, 0.1), "sigma": 3.0,
}  # fmt: skip
actions_of_three = st.lists(
    st.tuples(*[st.tuples(st.floats(-1, 1), st.floats(-1, 1))] * 3), min_size=1, max_size=20
)


def started(seed: int = 3, **fields: Any) -> SearchEnv:
    env = parallel_env(**{**PLACE, **fields})
    env.reset(seed=seed)
    return env


def flown(env: SearchEnv, joint: Any) -> Any:
    return env.step({agent: np.array(joint[int(agent[5:])]) for agent in env.agents})


def test_it_has_the_interface_of_pettingzoo() -> None:
    parallel_api_test(parallel_env(**PLACE), 200)
    api_test(aec_env(**PLACE), 100)


def test_a_drone_starts_at_cruise_and_faces_the_last_known_position() -> None:
    env = parallel_env(**PLACE, person_initial_position=(9, 2))
    observations, infos = env.reset(seed=3)
    east, south, heading_east, heading_north, speed = observations["drone0"][0].tolist()
    assert (east, south, speed) == pytest.approx((9.5 / 20, 9.5 / 20, 1.0))
    assert (heading_east, heading_north) == pytest.approx((0.0, 1.0))
    assert infos["drone0"].keys() == {"Found", "path"}
    # North for a step of 13 s at 10 m/s.
    after, *_, infos = env.step({agent: np.array([0.0, 1.0]) for agent in env.agents})
    assert after["drone0"][0][:2].tolist() == pytest.approx([9.5 / 20, 8.5 / 20])
    assert infos["drone0"]["path"].tolist() == [[1235.0, 1235.0], [1235.0, 1105.0]]


@settings(max_examples=20, deadline=None)
@given(actions_of_three, st.integers(0, 100))
def test_one_environment_is_a_batch_of_one_and_a_copy_goes_on_bit_for_bit(
    joints: list[Any], seed: int
) -> None:
    env, batch = started(seed), vector_env(2, **PLACE)
    batch.reset(seed=seed)
    twin, restored = pickle.loads(pickle.dumps(env)), started(seed + 1)
    restored.restore(env.snapshot())
    for joint in joints:
        if not env.agents:
            break
        observations, rewards, *_ = flown(env, joint)
        many, of_many, *_ = batch.step(np.array([joint, joint]))
        for agent, (state, probability) in observations.items():
            assert state.tolist() == many["states"][0, int(agent[5:])].tolist()
            assert probability.tobytes() == many["probability"][0].tobytes()
            assert rewards[agent] == of_many[0, int(agent[5:])]
        for other in (twin, restored):
            flown(other, joint)
            assert other.world.state_bytes() == env.world.state_bytes()


@settings(max_examples=30, deadline=None)
@given(actions_of_three)
def test_no_drone_leaves_the_grid_and_its_cell_is_the_one_that_it_is_in(joints: list[Any]) -> None:
    env = started(drones_positions=((0, 0), (19, 0), (10, 19)))
    for joint in joints:
        if not env.agents:
            break
        flown(env, joint)
        assert env.world.metres is not None
        paths, drones = env.world.metres.paths[0], env.world.drones[0]
        assert ((paths >= 0.0) & (paths <= 20 * 130.0)).all()
        inside = np.minimum(paths[:, -1] // 130.0, 19)
        assert inside.tolist() == np.stack([drones["x"], drones["y"]], axis=1).tolist()


def test_a_withdrawn_drone_stays_and_the_others_go_on() -> None:
    env = started(probability_of_detection=0.0)
    assert env.withdraw(1) and not env.withdraw(1)
    where = env.world.metres.states[0, 1].copy()  # type: ignore[union-attr]
    actions: dict[str, Any] = {"drone0": np.zeros(2), "drone1": "ignored", "drone2": np.zeros(2)}
    *_, terminated, _, _ = env.step(actions)
    assert terminated == {"drone0": False, "drone1": True, "drone2": False}
    assert env.agents == ["drone0", "drone2"]
    assert env.world.metres.states[0, 1] == where  # type: ignore[union-attr]


def test_batches_have_the_interface_of_gymnasium() -> None:
    joint = JointVectorEnv(vector_env(3, **PLACE))
    observations, _ = joint.reset(seed=1)
    assert joint.observation_space.contains(observations)
    observations, rewards, *_ = joint.step(joint.action_space.sample())
    assert joint.observation_space.contains(observations) and rewards.shape == (3,)


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        ({}, "actions: drone0 is missing; one action per live agent"),
        ({"drone0": (0, 2)}, "action of drone0 must be two numbers from -1 to 1, turn and speed"),
        ({"drone0": 1}, "action of drone0 must be two numbers from -1 to 1"),
        ({"drone0": "x"}, "action of drone0 must be two numbers from -1 to 1"),
        ({"drone0": (0, float("nan"))}, "action of drone0 must be two numbers from -1 to 1"),
        (3, "actions must be two numbers per live agent, got 3"),
    ],
)
def test_an_action_that_is_no_turn_and_speed_is_refused_with_nothing_changed(
    actions: Any, message: str
) -> None:
    env = started()
    before = env.world.state_bytes()
    with pytest.raises(FieldError, match=re.escape(message)):
        env.step(actions)
    assert env.world.state_bytes() == before


@pytest.mark.parametrize("wrong", [np.zeros((2, 3)), np.full((2, 3, 2), 1.5), "x", np.nan])
def test_a_batch_refuses_them_too(wrong: Any) -> None:
    batch = vector_env(2, **PLACE)
    batch.reset(seed=1)
    before = batch.world.state_bytes()
    with pytest.raises(FieldError, match="^actions must be"):
        batch.step(wrong)
    assert batch.world.state_bytes() == before


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"sensor": "own_cell"}, "sensor must be one of .*flown_over.* with space metres"),
        ({"stuck_rate": 0.1}, "stuck_rate must be 0 with space metres"),
        ({"battery_move": 1.0}, "battery_move must be 0 with space metres"),
        ({"person_motion": "window"}, "person_motion must be one of .* with space metres"),
        ({"actions": ("left", "search")}, "actions must be .* with space metres"),
        ({"collisions": True}, "collisions must be .* with space metres"),
        ({"task": "cover"}, "task must be 'find' with space metres"),
        (
            {"sensor": "sweep_width", "detection_law": "random_search"},
            "detection_law must be inverse_cube with space metres",
        ),
    ],
)
def test_what_is_for_cells_only_is_refused_in_one_line(fields: Any, message: str) -> None:
    with pytest.raises(FieldError, match=message) as refused:
        parallel_env(**{**PLACE, **fields})
    assert "\n" not in str(refused.value)


def test_the_profile_is_that_of_the_sea_but_for_space() -> None:
    rules, sea = profile("flight"), profile("sea")
    assert rules.in_metres and not sea.in_metres
    assert (rules.sensor, rules.person_motion) == (sea.sensor, sea.person_motion)


@settings(max_examples=20, deadline=None)
@given(st.tuples(st.floats(0.1, 0.9), st.floats(0.1, 0.9)), st.floats(0, 5), st.floats(0, 360))
def test_a_drone_flies_to_its_waypoint_and_stays_there(
    place: tuple[float, float], wind_speed: float, wind_toward: float
) -> None:
    env = Waypoints(
        started(probability_of_detection=0.0, wind_speed=wind_speed, wind_toward=wind_toward)
    )
    env.reset(seed=1)
    for _ in range(60):
        observations, *_ = env.step(dict.fromkeys(env.agents, np.array(place)))
    for state, _ in observations.values():
        assert np.abs(state[:2] - place).max() * 20 * 130.0 < 2.0


def test_waypoints_have_the_interface_of_pettingzoo_and_refuse_what_is_off_the_grid() -> None:
    env = Waypoints(started())
    parallel_api_test(env, 100)
    env.reset(seed=1)
    for wrong in (1.5, np.nan, "x", (0.1, 0.2, 0.3)):
        with pytest.raises(FieldError, match="action of drone0 must be two numbers from 0 to 1"):
            env.step(dict.fromkeys(env.agents, wrong))
    with pytest.raises(FieldError, match="drone0 is missing"):
        env.step({})
    with pytest.raises(FieldError, match="env must be a SearchEnv"):
        Waypoints(parallel_env(grid_size=6))  # type: ignore[arg-type]

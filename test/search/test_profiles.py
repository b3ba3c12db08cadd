# SPDX-License-Identifier: Apache-2.0
"""Every profile is data on one kernel, and keeps the promises of the environment."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Any

import numpy as np
import pytest
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, render_test
from play import some_actions, started

from dsse_ros.search import PROFILES, aec_env, parallel_env, profile, vector_env

RULES = tuple(PROFILES)


@pytest.mark.parametrize("drones", [1, 8, 100])
@pytest.mark.parametrize("rules", ["v1", "v2"])
def test_pettingzoo_accepts_it(rules: str, drones: int) -> None:
    fields: dict[str, Any] = {"grid_size": 20, "num_drones": drones, "rules": rules}
    parallel_api_test(parallel_env(**fields))
    parallel_seed_test(partial(parallel_env, **fields))
    api_test(aec_env(**fields))


@pytest.mark.parametrize("rules", ["v1", "v2"])
def test_pettingzoo_can_draw_it(rules: str) -> None:
    render_test(partial(aec_env, rules=rules))


@pytest.mark.parametrize("rules", RULES)
def test_a_million_steps_keep_the_world_whole(rules: str) -> None:
    batch, drones, grid = 2000, 4, 8
    env = vector_env(
        batch, rules=rules, grid_size=grid, num_drones=drones, vector=(0.37, -0.61), copy=False,
        timestep_limit=40, person_initial_position=(3, 4), person_amount=2,
    )  # fmt: skip
    generator = np.random.default_rng(0)
    _, infos = env.reset(seed=0)
    margin = int(profile(rules).leave_policy == "fly_on")
    out = np.zeros((batch, drones), bool)
    for _ in range(500):
        fresh = infos["over"]
        actions = generator.integers(0, len(env.rules.actions), (batch, drones)).astype(np.int8)
        observations, rewards, terminated, truncated, infos = env.step(actions)
        p = observations["probability"]
        assert np.isfinite(p).all() and (p >= 0).all()
        assert np.abs(p.sum(axis=(1, 2), dtype=float) - 1).max() <= 1e-6
        cells = observations["positions"]
        assert ((cells >= -margin) & (cells < grid + margin)).all()
        persons = env.world.persons
        walked_out = (persons["x"] < 0) | (persons["y"] < 0)
        if rules != "v1":
            assert not walked_out.any()
        assert (persons["x"] < grid).all() and (persons["y"] < grid).all()
        assert np.isfinite(rewards).all()
        now_out = terminated | truncated
        if not env.rules.ends_together:
            # Nobody comes back before the reset of the whole world.
            assert (now_out | ~out | fresh[:, None]).all()
        out = now_out


@pytest.mark.parametrize("rules", RULES)
def test_any_single_field_can_be_overridden(rules: str) -> None:
    for field in dataclasses.fields(profile(rules)):
        value = getattr(profile(rules), field.name)
        if isinstance(value, bool):
            other: Any = not value
        elif isinstance(value, float):
            other = value + 0.25 if field.name != "search_min_probability" else 0.5
        else:
            continue
        changed = profile(rules, **{field.name: other})
        assert getattr(changed, field.name) == other
        env = parallel_env(rules=changed, grid_size=5, num_drones=2)
        env.reset(seed=0)
        for _ in range(8):
            env.step(some_actions(env, np.random.default_rng(0)))


def test_v1_ends_for_all_when_one_leaves() -> None:
    env = started(rules="v1", grid_size=6, num_drones=3, person_initial_position=(5, 5))
    observations, rewards, terminated, truncated, _ = env.step(
        {"drone0": 0, "drone1": 3, "drone2": 3}
    )
    assert rewards == {"drone0": -100000, "drone1": 1, "drone2": 1}
    assert terminated == {"drone0": True, "drone1": False, "drone2": False}
    assert all(truncated.values()) and env.agents == []
    assert observations["drone0"][0].tolist() == [-1, 0]
    assert all(env.observation_space(a).contains(o) for a, o in observations.items())


def test_v1_takes_any_other_action_as_a_rest() -> None:
    env = started(rules="v1", grid_size=6, num_drones=2, person_initial_position=(5, 5))
    before = env.positions
    others: list[Any] = [5, -1, 300, 10**30, 2.5, 7j, "left", None]
    for number in (*others, np.array([9]), np.array([1, 2])):
        *_, rewards = env.step({"drone0": number, "drone1": 9})[:2]
        assert rewards == {"drone0": 1, "drone1": 1}
        assert np.array_equal(env.positions, before)
    for number in (3.0, np.float32(3), np.array([3])):
        env.step({"drone0": number, "drone1": 9})  # type: ignore[dict-item]
    assert env.positions.tolist() == [[0, 3], [1, 0]]


def test_v2_moves_diagonally_and_stays_at_the_border() -> None:
    env = started(
        rules="v2", grid_size=6, drones_positions=[(1, 1)], person_initial_position=(5, 5)
    )
    legend = {name: i for i, name in enumerate(env.rules.actions)}
    for name, cell in (
        ("down_right", (2, 2)), ("up_left", (1, 1)), ("up_left", (0, 0)), ("up_right", (0, 0)),
        ("down_left", (0, 0)), ("down_right", (1, 1)), ("up_right", (2, 0)), ("down_left", (1, 1)),
    ):  # fmt: skip
        _, rewards, *_ = env.step({"drone0": legend[name]})
        assert env.positions.tolist() == [list(cell)] and rewards == {"drone0": 0}


def test_v2_multipliers_and_detection_decide_who_is_found() -> None:
    cell = (3, 3)
    for pod, multiplier, found in ((1.0, 1.0, True), (0.5, 2.0, True), (1.0, 0.0, False)):
        env = parallel_env(
            rules="v2", grid_size=8, vector=(0, 0), drones_positions=[cell],
            person_initial_position=cell, probability_of_detection=pod,
        )  # fmt: skip
        env.reset(seed=0, options={"person_pod_multipliers": [multiplier]})
        _, rewards, terminated, _, infos = env.step({"drone0": 8})
        assert infos["drone0"]["Found"] is found and terminated["drone0"] is found
        assert rewards["drone0"] == (2.0 if found else 0.0)


def test_v2_detects_as_often_as_the_probability_says() -> None:
    cell, searches = (3, 3), 4000
    env = vector_env(
        searches, rules="v2", grid_size=8, vector=(0, 0), drones_positions=[cell],
        person_initial_position=cell, probability_of_detection=0.3,
    )  # fmt: skip
    env.reset(seed=0)
    *_, infos = env.step(np.full((searches, 1), 8, np.int8))
    assert abs(infos["Found"].mean() - 0.3) < 5 * np.sqrt(0.3 * 0.7 / searches)


def test_v2_persons_without_room_are_refused() -> None:
    with pytest.raises(ValueError, match="person_amount: 10 is not allowed; at most 9"):
        parallel_env(rules="v2", person_amount=10, person_initial_position=(0, 0))
    parallel_env(rules="v2", person_amount=9, person_initial_position=(0, 0)).reset(seed=0)


def test_pre_search_minutes_are_steps_of_drift_before_the_first_observation() -> None:
    fields: dict[str, Any] = {"rules": "v2", "grid_size": 30, "person_initial_position": (9, 9)}
    late = started(pre_search_minutes=10, **fields)
    early = started(**fields)
    for _ in range(46):
        early.world.step(np.full((1, 1), -1, np.int8))
    assert np.array_equal(late.probability, early.probability)
    assert late.world.worlds["t"][0] == 0

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every profile is data on one kernel, and keeps the promises of the environment."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, render_test
from play import started

from dsse_ros.base.fields import FieldError, specs
from dsse_ros.search.environments.aec import aec_env
from dsse_ros.search.environments.factories import parallel_env, vector_env
from dsse_ros.world.scenario.rules import PROFILES, CoverageRules, Rules, profile
from dsse_ros.world.targets.registry import TARGET_MODELS

RULES = tuple(PROFILES)


@pytest.mark.slow
@pytest.mark.parametrize("drones", [1, 8, 100])
@pytest.mark.parametrize("rules", ["v1", "v2"])
def test_pettingzoo_accepts_it(rules: str, drones: int) -> None:
    fields: dict[str, Any] = {"grid_size": 20, "num_drones": drones, "rules": rules}
    parallel_api_test(parallel_env(**fields))
    parallel_seed_test(partial(parallel_env, **fields))
    api_test(aec_env(**fields))


@pytest.mark.slow
@pytest.mark.parametrize("rules", ["v1", "v2"])
def test_pettingzoo_can_draw_it(rules: str) -> None:
    render_test(partial(aec_env, rules=rules))


@pytest.mark.slow
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
        if env.rules.in_metres:
            actions = generator.uniform(-1.0, 1.0, (batch, drones, 2))
        else:
            actions = generator.integers(0, len(env.rules.actions), (batch, drones)).astype(np.int8)
        observations, rewards, terminated, truncated, infos = env.step(actions)
        p = observations["probability"]
        assert np.isfinite(p).all() and (p >= 0).all()
        total = p.sum(axis=(1, 2), dtype=float)
        assert total.max() <= 1 + 1e-6
        drifts_off = env.world.ensemble is not None
        assert env.rules.covers or drifts_off or total.min() >= 1 - 1e-6
        cells = np.stack([env.world.drones[axis] for axis in "xy"], axis=-1)
        assert env.rules.in_metres or np.array_equal(cells, observations["positions"])
        assert ((cells >= -margin) & (cells < grid + margin)).all()
        persons = env.world.persons
        walked_out = (persons["x"] < 0) | (persons["y"] < 0)
        if rules != "v1" and not drifts_off:
            assert not walked_out.any()
        beyond = (persons["x"] >= grid) | (persons["y"] >= grid)
        assert drifts_off or not beyond.any()
        assert np.isfinite(rewards).all()
        now_out = terminated | truncated
        if not env.rules.ends_together:
            # Nobody comes back before the reset of the whole world.
            assert (now_out | ~out | fresh[:, None]).all()
        out = now_out


PLACE: dict[str, Any] = {
    "grid_size": 6, "drones_positions": [(2, 3), (3, 3), (0, 0), (5, 5)], "vector": (0.37, -0.61),
    "person_initial_position": (2, 3), "person_amount": 2, "probability_of_detection": 0.5,
    "timestep_limit": 25, "sigma": 1.5, "dispersion_inc": 0.02,
}  # fmt: skip
OTHERS: dict[str, tuple[Any, ...]] = {
    "actions": (("search", "down", "right", "up", "left"),),
    "leave_policy": ("stay", "fly_on"),
    "search_min_probability": (0.2,),
    "time_out_grace": (2,),
    "drift_remainder": ("dropped", "less_one"),
    "task": ("cover",),
    "cover_min_probability": (0.05,),
    "reset_sea_steps": (1,),
    "person_motion": tuple(name for name in TARGET_MODELS if name != "window"),
    "person_scatter": (2,),
    "person_steps": ((0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),),
    "grid_size": (7,),
    "vector": ((0.5, 0.25),),
    "person_initial_position": ((1, 1),),
    "timestep_limit": (9,),
    "sensor": ("flown_over",),
}
"""Other values of the fields of which neither the opposite nor a little more will do."""
WHERE: dict[str, dict[str, Any]] = {
    # All the probability is in one cell, which is searched in vain.
    "search_min_inclusive": {"search_min_probability": 1.0, "probability_of_detection": 0.0},
    # More than a cell in one step.
    "drift_remainder": {"vector": (2.4, 0.3), "grid_size": 30},
    **{name: {"task": "cover"} for name in specs(CoverageRules) if name != "task"},
    # More than one cell.
    **dict.fromkeys(
        ("cover", "cover_scale", "cover_min_probability"),
        {"task": "cover", "reset_sea_steps": 10},
    ),
    "person_steps": {"person_motion": "random_walk"},
    # A diagonal.
    "timed_actions": {"actions": ("up_left", "down_right", "left", "right", "search")},
    # The map runs away from the persons.
    "person_walks_blind": {"vector": (2.0, 0.0), "grid_size": 30, "sigma": 0.5},
}
"""What makes a field matter that hardly ever does."""


def history(rules: Rules, place: dict[str, Any]) -> list[bytes]:
    """The whole state of many worlds, step after step of random actions."""
    env = vector_env(40, place, rules=rules, lazy=True)
    env.reset(seed=5)
    states = [env.world.state_bytes()]
    generator = np.random.default_rng(1)
    for _ in range(40):
        shape = (40, env.world.num_drones)
        env.step(generator.integers(0, len(rules.actions), shape).astype(np.int8))
        states.append(env.world.state_bytes())
    return states


def others(name: str, value: Any) -> tuple[Any, ...]:
    """Other values of a field of the rules."""
    if name in OTHERS:
        return OTHERS[name]
    return (not value,) if isinstance(value, bool) else (value + 0.25,)


# The profile's name is only that; unknown actions are a matter of the single environment, below;
# in metres there are no actions by number.
@pytest.mark.parametrize("name", sorted(specs(Rules).keys() - {"profile", "noop_actions", "space"}))
def test_every_field_of_the_rules_changes_the_search(name: str) -> None:
    usual = profile("paper")
    needed = WHERE.get(name, {})
    of_rules = {k: v for k, v in needed.items() if k in specs(Rules) and k not in PLACE}
    of_place = {k: v for k, v in needed.items() if k not in of_rules}
    # The scenario's own value would take the place of the profile's.
    place = {k: v for k, v in (PLACE | of_place).items() if k != name}
    usual = usual.override(**of_rules)
    for other in others(name, getattr(usual, name)):
        changed = history(usual.override(**{name: other}), place)
        assert changed != history(usual, place), other


def test_a_number_that_is_no_action_is_refused_or_does_nothing() -> None:
    env = started(num_drones=2)
    with pytest.raises(FieldError, match="action of drone0 must be one of .*, got 99"):
        env.step({"drone0": 99, "drone1": 4})
    env = started(num_drones=2, noop_actions=True)
    env.step({"drone0": 99, "drone1": 4})
    assert env.positions.tolist() == [[0, 0], [1, 0]]


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
    numbers = {name: i for i, name in enumerate(env.rules.actions)}
    for name, cell in (
        ("down_right", (2, 2)), ("up_left", (1, 1)), ("up_left", (0, 0)), ("up_right", (0, 0)),
        ("down_left", (0, 0)), ("down_right", (1, 1)), ("up_right", (2, 0)), ("down_left", (1, 1)),
    ):  # fmt: skip
        _, rewards, *_ = env.step({"drone0": numbers[name]})
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
    with pytest.raises(ValueError, match="person_amount must be at most 9, .* got 10"):
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

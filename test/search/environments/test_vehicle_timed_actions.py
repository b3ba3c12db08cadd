# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""With vehicle-timed actions, each action lasts until its vehicle has done it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.planners.registry import planner_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.step.fault_kernels import ACTING, COMING_BACK, DONE
from dsse_ros.search.step.viewpoints import viewpoints_at

PLACE = {
    "vehicle_timed_actions": True, "grid_size": 20, "drones_positions": [(10, 10)],
    "person_initial_position": (0, 0), "timestep_limit": 300,
}  # fmt: skip
rules = st.sampled_from(["paper", "v1", "v2", "sea"])


def started(**fields: Any) -> SearchEnv:
    env = parallel_env(**{**PLACE, **fields})
    env.reset(seed=1)
    return env


def stepped(env: SearchEnv, action: int, work: int) -> dict[str, Any]:
    """Step with a drone whose vehicle still has that work to do; return the drone's infos."""
    assert env.world.faults is not None
    env.world.faults.set_work(np.full(env.world.num_drones, work, np.int8))
    infos: dict[str, Any] = env.step({"drone0": action})[4]["drone0"]
    return infos


@given(rules, st.lists(st.tuples(st.integers(0, 8), st.integers(0, 12), st.integers(0, 3))))
def test_a_drone_acts_once_when_its_vehicle_has_and_is_free_when_that_is_back(
    name: str, legs: list[tuple[int, int, int]]
) -> None:
    env = started(rules=name)
    for action, acting, coming in legs:
        action %= len(env.rules.actions)
        acting = 0 if not env.world.action_masks()[0, 0, action] else acting
        work = [ACTING] * acting + [COMING_BACK] * coming + [DONE]
        for k, now in enumerate(work):
            if not env.agents:
                return
            cell = env.positions[0].tolist()
            infos = stepped(env, action if k == 0 else (action + k) % len(env.rules.actions), now)
            acts = k == acting
            assert infos["action"] == (action if acts else -1)
            if not acts:
                assert env.positions[0].tolist() == cell
            if env.agents:
                assert (infos["status"] == "under_way") == (now != DONE)
                if now != DONE:
                    assert np.flatnonzero(infos["action_mask"]).tolist() == [action]


def test_without_a_report_each_action_takes_a_step() -> None:
    env = started(rules="v2")
    up, search = (env.rules.actions.index(name) for name in ("up", "search"))
    for action in (up, search, up, up):
        assert env.step({"drone0": action})[4]["drone0"]["action"] == action
    assert env.positions.tolist() == [[10, 7]]


def test_nobody_is_found_before_the_vehicle_has_looked() -> None:
    env = started(
        rules="v2", person_initial_position=(10, 10), person_motion="random_walk",
        person_steps=[0.0] * 4 + [1.0] + [0.0] * 4, probability_of_detection=1.0,
    )  # fmt: skip
    search = env.rules.action_set.search
    for _ in range(7):
        stepped(env, search, ACTING)
        assert env.world.worlds["num_missing"][0] == 1
    stepped(env, search, COMING_BACK)
    assert env.world.worlds["num_missing"][0] == 0 and not env.agents


@given(st.lists(st.tuples(st.integers(0, 4), st.sampled_from([DONE, COMING_BACK, ACTING]))))
def test_what_drones_begin_is_what_they_then_do(happenings: list[tuple[int, int]]) -> None:
    env = started(stuck_rate=0.2, stuck_steps=2, command_drop_rate=0.2, loss_rate=0.02)
    faults = env.world.faults
    assert faults is not None
    for action, work in happenings:
        if not env.agents:
            return
        before = env.world.state_bytes()
        begun, goes_on = faults.begun(env.world.batch, np.array([action], np.int8))
        assert env.world.state_bytes() == before
        heading = int(faults.conditions["heading"][0, 0])
        assert not goes_on[0] or begun[0] == heading
        stepped(env, action, work)
        done = int(faults.applied[0, 0])
        assert done in (-1, begun[0])
        if work == ACTING:
            assert done == -1


@pytest.mark.parametrize("name", ["paper", "sea"])
def test_such_a_mission_goes_on_from_its_snapshot_bit_for_bit(name: str) -> None:
    rng = np.random.default_rng(3)
    env = started(rules=name)
    choices = rng.integers(0, (len(env.rules.actions), 3), (60, 2)).tolist()
    for action, work in choices[:25]:
        stepped(env, action, work)
    kept, seen = env.snapshot(), []
    for _ in range(2):
        seen.append([])
        for action, work in choices[25:]:
            if env.agents:
                stepped(env, action, work)
            seen[-1].append(env.world.state_bytes())
        env.restore(kept)
    assert seen[0] == seen[1]


def test_a_planner_learns_from_where_the_vehicle_looked() -> None:
    env = started(rules="paper", observe="belief", probability_of_detection=0.1)
    planner, draw, pos = planner_for(env, "belief_greedy"), np.random.default_rng(1), 0.0
    observations, infos = env.reset(seed=1)
    for _ in range(12):
        actions = planner(observations, infos)
        assert planner.belief.pos == pytest.approx(pos, rel=1e-6)  # type: ignore[attr-defined]
        assert env.world.viewpoints is not None
        looks = viewpoints_at(np.array([env.rules.action_set.search]), *draw.integers(0, 3, (2, 1)))
        env.world.viewpoints.preset(looks)
        observations, *_, infos = env.step(actions)
        pos = infos["drone0"]["pos"]
    assert pos > 0.05

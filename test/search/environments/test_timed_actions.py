# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""With timed actions, each action takes its own time, and a drone is under way meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.action_times import action_times
from dsse_ros.world.searchers.registry import SEARCHERS
from dsse_ros.world.searchers.searcher import Searcher

PLACE = {
    "rules": "v2", "timed_actions": True, "grid_size": 40, "drones_positions": [(20, 20)],
    "person_initial_position": (0, 0), "timestep_limit": 300,
}  # fmt: skip
LOW = Searcher(
    doc="searches from 30 m", search_altitude=30.0, descent_speed=2.0, climb_speed=3.0,
    search_time=5.0,
)  # fmt: skip


@pytest.fixture(autouse=True)
def low(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setitem(SEARCHERS, "low", LOW)
    yield


def steps_of(env: SearchEnv, action: str) -> int:
    """Do an action and return the steps until the drone takes its next command."""
    number, taken = env.rules.actions.index(action), 0
    while True:
        _, _, _, _, infos = env.step({"drone0": number})
        taken += 1
        if infos["drone0"]["status"] != "under_way":
            return taken
        assert infos["drone0"]["action_mask"].tolist() == [
            k == number for k in range(len(env.rules.actions))
        ]


def started(**fields: Any) -> SearchEnv:
    env = parallel_env(**{**PLACE, **fields})
    env.reset(seed=1)
    return env


def test_a_diagonal_takes_as_much_longer_as_it_is() -> None:
    env = started()
    times = dict(zip(env.rules.actions, action_times(env.scenario, env.rules).takes, strict=True))
    assert times["up"] == times["search"] == 1.0
    assert times["up_left"] == pytest.approx(sqrt(2))
    assert [steps_of(env, "up_left") for _ in range(7)] == [2, 1, 2, 1, 2, 1, 1]


@settings(max_examples=25, deadline=None)
@given(st.lists(st.sampled_from(["up", "left", "up_left", "down_right", "search"]), max_size=25))
def test_actions_without_a_pause_take_their_times_together(actions: list[str]) -> None:
    env, taken, elapsed = started(), 0, 0.0
    for action in actions:
        taken += steps_of(env, action)
        elapsed += sqrt(2) if "_" in action else 1.0
        assert taken == ceil(elapsed - 1e-6)


def test_in_the_wind_a_leg_takes_its_length_over_the_ground_speed() -> None:
    env = started(wind_speed=5.0, wind_toward=270.0)
    times = dict(zip(env.rules.actions, action_times(env.scenario, env.rules).takes, strict=True))
    assert times["right"] == pytest.approx(2.0)
    assert times["up"] == pytest.approx(1 / sqrt(0.75))
    # A step is the least that an action takes.
    assert times["left"] == 1.0
    assert [steps_of(env, "right") for _ in range(3)] == [2, 2, 2]


def test_a_search_from_below_looks_when_it_is_down_and_takes_the_climb_too() -> None:
    env = started(searchers=("low",), altitude=120.0)
    step_s = env.scenario.step_duration_s
    times = action_times(env.scenario, env.rules, env.scenario.kinds[0])
    search = env.rules.action_set.search
    assert times.takes[search] == pytest.approx((45.0 + 5.0) / step_s)
    assert times.after[search] == pytest.approx(30.0 / step_s)
    looked: list[int] = []
    for step in range(1, 10):
        _, _, _, _, infos = env.step({"drone0": search})
        if infos["drone0"]["action"] == search:
            looked.append(step)
        if infos["drone0"]["status"] != "under_way":
            break
    assert looked == [ceil((45.0 + 5.0) / step_s)]
    assert step == ceil((45.0 + 5.0 + 30.0) / step_s)


def test_a_climb_binds_a_drone_whose_search_fits_into_a_step() -> None:
    env = started(
        searchers=("low",), altitude=40.0, cell_size=130.0,
        actions=("left", "right", "up", "down", "search"),
    )  # fmt: skip
    times = action_times(env.scenario, env.rules, env.scenario.kinds[0])
    search = env.rules.action_set.search
    assert times.takes[search] == 1.0 < times.takes[search] + times.after[search]
    assert [steps_of(env, "search") for _ in range(3)] == [2, 1, 1]


def test_nobody_is_found_before_the_drone_has_looked() -> None:
    env = started(searchers=("low",), person_initial_position=(20, 20), vector=(0.0, 0.0))
    search, step = env.rules.action_set.search, 0
    while env.agents:
        env.step({"drone0": search})
        step += 1
    assert env.world.worlds["num_missing"][0] == 0
    assert step == ceil((45.0 + 5.0) / env.scenario.step_duration_s)


def test_a_mission_of_timed_actions_goes_on_from_its_snapshot_bit_for_bit() -> None:
    rng = np.random.default_rng(3)
    env = started(searchers=("low", "drone"), drones_positions=[(20, 20), (5, 5)])
    choices = rng.integers(0, len(env.rules.actions), (60, 2)).tolist()
    kept, seen = None, []
    for step, choice in enumerate(choices):
        if step == 25:
            kept = env.snapshot()
        seen.append(stepped(env, choice))
    assert kept is not None
    env.restore(kept)
    assert [stepped(env, choice) for choice in choices[25:]] == seen[25:]


def stepped(env: SearchEnv, choice: list[int]) -> tuple[dict[str, float], Any]:
    """Step with the actions of all drones that are left; return rewards and cells."""
    actions = {f"drone{n}": a for n, a in enumerate(choice) if f"drone{n}" in env.agents}
    return env.step(actions)[1], env.positions.tolist()

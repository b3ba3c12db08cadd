# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""All get valid work that lasts, whatever the rules."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.speed import CALLS, CELLS, GOAL_CELLS, QUICK_CELLS, configuration
from benchmarks.workload import MAP_BYTES, batch_size, random_walks
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.rules import ACTION_VECTORS, profile


def walks(rules: str, grid_size: int, num_drones: int, worlds: int = 3) -> tuple:
    """Start cells and actions of an episode."""
    names = profile(rules).actions
    return random_walks(grid_size, num_drones, names, CALLS[rules], worlds, seed=1)


@given(
    rules=st.sampled_from(["v1", "v2"]),
    grid_size=st.integers(2, 30),
    share=st.floats(0.0, 0.5),
)
@settings(max_examples=30, deadline=None)
def test_drones_stay_on_the_grid_and_never_meet(rules: str, grid_size: int, share: float) -> None:
    starts, actions = walks(rules, grid_size, max(1, int(share * grid_size**2)))
    vectors = np.array([ACTION_VECTORS[name] for name in profile(rules).actions])
    cells = starts + vectors[actions].cumsum(axis=0)
    assert ((cells >= 0) & (cells < grid_size)).all()
    numbers = np.sort(cells @ [1, grid_size], axis=-1)
    assert (np.diff(numbers, axis=-1) > 0).all()


@pytest.mark.parametrize("rules", ["v1", "v2"])
def test_searches_are_as_frequent_as_any_other_action(rules: str) -> None:
    names = profile(rules).actions
    _, actions = walks(rules, 40, 5, worlds=64)
    searches = (actions == names.index("search")).mean()
    assert searches == pytest.approx(1 / len(names), abs=0.01)


@pytest.mark.parametrize("rules", ["v1", "v2"])
def test_an_episode_lasts_until_its_time_is_out(rules: str) -> None:
    starts, actions = walks(rules, 20, 5)
    env = parallel_env(**configuration(rules, 20, 5)["fields"], drones_positions=starts.tolist())
    env.reset(seed=1)
    calls = 0
    while env.agents:
        joint = actions[calls, 0].tolist()
        env.step(dict(zip(env.possible_agents, joint, strict=True)))
        calls += 1
    assert calls == len(actions)


@given(st.integers(1, 2000))
def test_the_maps_of_a_batch_fit_in_memory(grid_size: int) -> None:
    assert 1 <= batch_size(grid_size) <= 1024
    assert batch_size(grid_size) * grid_size**2 * 4 <= MAP_BYTES


def test_the_goals_are_measured_in_a_quick_run_too() -> None:
    assert {*GOAL_CELLS} <= {*QUICK_CELLS} <= {*CELLS}

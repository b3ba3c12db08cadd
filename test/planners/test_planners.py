# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises that all planners keep, on the bare grid and on the search environment."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grid_walker import DIAGONAL, STRAIGHT, GridWalker
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.planners.registry import PLANNERS, make_planner
from dsse_ros.search.environments.factories import parallel_env

names = st.sampled_from(sorted(PLANNERS))
action_names = st.sampled_from([STRAIGHT, DIAGONAL])


@st.composite
def walks(draw: st.DrawFn) -> tuple[int, list[tuple[int, int]], int]:
    """The size of a grid, starts of drones on it, and a seed."""
    size = draw(st.integers(1, 9))
    starts = draw(st.lists(st.integers(0, size * size - 1), unique=True, min_size=1))
    return size, [(k % size, k // size) for k in starts], draw(st.integers(0, 2**32))


def test_an_unknown_planner_is_refused_in_one_line_that_lists_the_known_ones() -> None:
    with pytest.raises(ValueError, match="'swep'") as refusal:
        make_planner("swep", STRAIGHT)
    assert "\n" not in str(refusal.value)
    assert all(name in str(refusal.value) for name in PLANNERS)


@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_actions_without_search_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match="search missing"):
        make_planner(name, STRAIGHT[:-1])


@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_without_drones_there_are_no_actions(name: str) -> None:
    assert make_planner(name, STRAIGHT)({}, {}) == {}


@pytest.mark.slow
@settings(deadline=None)
@given(walks(), names, action_names, st.data())
def test_no_drone_leaves_the_grid_or_meets_another(
    walk: tuple[int, list[tuple[int, int]], int],
    name: str,
    actions: tuple[str, ...],
    data: st.DataObject,
) -> None:
    size, starts, seed = walk
    walker = GridWalker(size, starts, actions)
    planner = make_planner(name, actions, seed=seed)
    rng = np.random.default_rng(seed)
    for _ in range(3):
        for _ in range(10):
            walker.probability = rng.random((size, size), np.float32)
            walker.step(planner)
        lost = data.draw(st.sets(st.sampled_from(sorted(walker.cells))))
        walker.lose(sorted(lost)[: len(walker.cells) - 1])


@settings(deadline=None, max_examples=30)
@given(walks(), names, action_names)
def test_the_same_seed_gives_the_same_actions(
    walk: tuple[int, list[tuple[int, int]], int], name: str, actions: tuple[str, ...]
) -> None:
    size, starts, seed = walk
    one, other = GridWalker(size, starts, actions), GridWalker(size, starts, actions)
    planners = [make_planner(name, actions, seed=seed) for _ in range(2)]
    for _ in range(20):
        assert one.step(planners[0]) == other.step(planners[1])


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(PLANNERS))
@pytest.mark.parametrize("num_drones", [1, 2, 7, 64])
@pytest.mark.parametrize("seed", [0, 1])
def test_no_drone_is_terminated_in_the_search_but_by_a_find(
    name: str, num_drones: int, seed: int
) -> None:
    fleet: dict[str, Any] = {"grid_size": 8, "num_drones": num_drones}
    env = parallel_env(
        rules="paper",
        **fleet,
        vector=(0.3, -0.2),
        person_initial_position=(6, 5),
        timestep_limit=150,
    )
    planner = make_planner(name, env.unwrapped.rules.actions, seed=seed)
    observations, infos = env.reset(seed=seed)
    while env.agents:
        agents = list(env.agents)
        assert len(agents) == num_drones
        observations, _, terminated, truncated, infos = env.step(planner(observations, infos))
        ended = [agent for agent in agents if terminated[agent] or truncated[agent]]
        assert all(truncated[agent] or infos[agent]["Found"] for agent in ended)
        observations = {agent: observations[agent] for agent in env.agents}
    env.close()


def test_a_sweep_of_a_still_sea_finds_the_person() -> None:
    env = parallel_env(
        rules="paper",
        grid_size=8,
        num_drones=4,
        vector=(0.0, 0.0),
        sigma=0.01,
        person_initial_position=(6, 5),
        timestep_limit=150,
    )
    planner = make_planner("sweep", env.unwrapped.rules.actions)
    observations, infos = env.reset(seed=0)
    found = False
    while env.agents and not found:
        observations, _, _, _, infos = env.step(planner(observations, infos))
        found = all(info["Found"] for info in infos.values())
    assert found

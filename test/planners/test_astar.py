# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Planners on the coverage task: A*, and routes over what is left to cover."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from areas import random_mask, scenario_of

from dsse_ros.base.fields import FieldError
from dsse_ros.planners.astar import next_cell
from dsse_ros.planners.batch import play_missions
from dsse_ros.planners.registry import PERSON_PLANNERS, PLANNERS, planner_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.rules import profile

ACTIONS = profile("coverage").action_set
LIMIT = 2000
"""Steps: enough for all of it."""


def flown(env: SearchEnv, name: str, seed: int = 0) -> tuple[int, float]:
    """Fly a mission to its end; returns its steps and coverage rate."""
    planner = planner_for(env, name, seed=seed)
    observations, infos = env.reset(seed=seed)
    rate = 0.0
    while env.agents:
        actions = planner(observations, infos)
        for agent, action in actions.items():
            assert infos[agent]["action_mask"][action]
        observations, _, _, _, infos = env.step(actions)
        assert len(np.unique(env.positions, axis=0)) == len(env.positions)
        rate = next(iter(infos.values()))["coverage_rate"]
    return env.steps_done, rate


def patches(seed: int) -> Any:
    """A matrix with probability in some of the cells."""
    rng = np.random.default_rng(seed)
    return rng.random((12, 12)) * (rng.random((12, 12)) < 0.4)


@pytest.mark.parametrize("drones", [1, 4])
@pytest.mark.parametrize("name", ["astar", "sweep", "spiral", "expanding_square"])
def test_all_is_covered_and_no_two_drones_are_in_one_cell(name: str, drones: int) -> None:
    for seed in range(3):
        env = parallel_env(
            rules="coverage", probability_matrix=patches(seed), num_drones=drones,
            timestep_limit=LIMIT,
        )  # fmt: skip
        steps, rate = flown(env, name, seed)
        assert rate == 1.0 and steps < LIMIT


def test_astar_takes_fewer_steps_than_a_sweep() -> None:
    steps = {
        name: sum(
            flown(
                parallel_env(
                    rules="coverage", probability_matrix=patches(seed), num_drones=2,
                    timestep_limit=LIMIT,
                ),
                name,
            )[0]
            for seed in range(4)
        )
        for name in ("astar", "sweep")
    }  # fmt: skip
    assert steps["astar"] < 0.9 * steps["sweep"]


@pytest.mark.parametrize("seed", range(4))
def test_astar_covers_what_its_drones_can_get_to_in_an_area(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = random_mask(rng, 9)
    fields = scenario_of(mask, rng, 2) | {"timestep_limit": 300}
    env = parallel_env(fields, rules="coverage", probability_matrix=rng.random((9, 9)))
    flown(env, "astar")
    reach = ACTIONS.within(mask)
    for x, y in np.argwhere(env.probability > 0)[:, ::-1].tolist():
        assert all(reach.distance(tuple(start), (x, y)) < 0 for start in env.positions.tolist())


def test_of_all_shortest_ways_it_takes_the_one_with_most_probability() -> None:
    left = np.zeros((5, 5), np.float32)
    # From (0, 2) to (4, 2) in four moves, over any of these.
    left[1, 1], left[0, 2], left[1, 3] = 0.2, 0.2, 0.2
    left[3, 1], left[3, 3] = 0.29, 0.29
    left[2, 4] = 0.1
    assert next_cell(ACTIONS, left, (0, 2), (4, 2), ()) == (1, 1)
    left[0, 2] = 0.1
    assert next_cell(ACTIONS, left, (0, 2), (4, 2), ()) == (1, 3)
    # The other drone is in the way.
    assert next_cell(ACTIONS, left, (0, 2), (4, 2), {(1, 3)}) == (1, 1)


@pytest.mark.slow
def test_a_planner_of_the_other_task_is_refused_in_one_line_that_lists_those_that_are_not() -> None:
    coverage = parallel_env(rules="coverage", grid_size=6)
    for name in PERSON_PLANNERS:
        with pytest.raises(FieldError, match=f"^planner must be .* got '{name}'$") as refusal:
            planner_for(coverage, name)
        assert "astar" in str(refusal.value) and "\n" not in str(refusal.value)
        with pytest.raises(FieldError, match="^planner must be "):
            play_missions(1, name, rules="coverage", grid_size=6)
    with pytest.raises(FieldError, match="^planner must .* with rules paper, .* got 'astar'$"):
        planner_for(parallel_env(grid_size=6), "astar")
    for name in PLANNERS:
        planner_for(coverage, name)


@pytest.mark.parametrize("name", ["astar", "random"])
def test_missions_played_together_are_those_played_one_by_one(name: str) -> None:
    fields: dict[str, Any] = {
        "rules": "coverage", "probability_matrix": patches(1), "num_drones": 2,
        "timestep_limit": 60,
    }  # fmt: skip
    played = play_missions(4, name, seed=0, planner_seeds=(0, 1), **fields)
    for mission in range(4):
        env = parallel_env(**fields)
        steps, rate = 0, 0.0
        planner = planner_for(env, name, seed=mission % 2)
        observations, infos = env.reset(seed=mission)
        while env.agents:
            observations, _, _, _, infos = env.step(planner(observations, infos))
            steps, rate = env.steps_done, infos["drone0"]["coverage_rate"]
        assert played.found[mission] == (rate == 1.0)
        assert played.steps[mission] == steps

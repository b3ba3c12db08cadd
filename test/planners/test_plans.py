# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What planners state of their plans, and what the drones then do."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from dsse_ros.planners.planner import Planning
from dsse_ros.planners.registry import planner_for
from dsse_ros.search.environments.factories import parallel_env

IN_METRES: dict[str, Any] = {
    "rules": "flight", "person_motion": "constant_drift", "grid_size": 30, "particles": 500,
    "num_drones": 2, "vector": (0.03, 0.02), "sigma": 3.0, "timestep_limit": 40,
    "probability_of_detection": 0.0, "wind_speed": 2.0, "wind_toward": 40.0,
}  # fmt: skip
ON_CELLS: dict[str, Any] = {
    "rules": "paper", "grid_size": 12, "num_drones": 2, "probability_of_detection": 0.0,
    "sigma": 2.0, "timestep_limit": 30, "drones_positions": ((5, 5), (6, 6)),
}  # fmt: skip
BEAM: dict[str, Any] = {"samples": 200, "horizon": 5, "width": 4}


def flown(env: Any, planner: Any) -> Any:
    """Yield the plans of each step, then the infos and the observations after it."""
    observations, infos = env.reset(seed=3)
    while env.agents:
        here = {agent: observations[agent] for agent in env.agents}
        for info in infos.values():
            info["step"] = env.steps_done
        actions = planner(here, infos)
        assert isinstance(planner, Planning)
        plans = planner.plans()
        observations, *_, infos = env.step(actions)
        # In the step after the time limit, no drone acts.
        if env.agents:
            yield plans, here, observations, infos


def test_drones_in_metres_fly_the_first_step_of_the_plan_of_a_beam_search() -> None:
    env = parallel_env(**IN_METRES)
    for plans, _, _, infos in flown(env, planner_for(env, "belief", seed=1, **BEAM)):
        assert plans.keys() == infos.keys()
        for agent, info in infos.items():
            path = info["path"][1:] / env.scenario.cell_size - 0.5
            # Actions are float32.
            assert plans[agent][: len(path)] == pytest.approx(path, abs=1e-5)
            assert len(plans[agent]) % len(path) == 0


@pytest.mark.parametrize("name", ["sweep", "expanding_square", "sector"])
def test_drones_in_metres_pass_the_corners_of_the_track_that_a_pattern_states(name: str) -> None:
    env = parallel_env(**IN_METRES)
    planner, paths = planner_for(env, name), {agent: [] for agent in env.possible_agents}
    first: Any = None
    for plans, _, _, infos in flown(env, planner):
        first = first or plans
        for agent, info in infos.items():
            paths[agent].append(info["path"])
            ends = plans[agent][0] - (info["path"][-1] / env.scenario.cell_size - 0.5)
            # At the end of the step the drone is where the plan begins.
            assert math.hypot(*ends) < 0.2
    for agent, plan in first.items():
        way = np.concatenate(paths[agent]) / env.scenario.cell_size - 0.5
        away = np.hypot(*np.moveaxis(plan[:, None] - way, 2, 0)).min(axis=1)
        # The wind and the corners take time that the plan does not know: the datum drifts on.
        near = away[: max(len(plan) // 2, 2)]
        assert near.max() < 0.8
        assert len(plan) >= 2


def test_greedy_in_metres_states_the_cell_that_it_flies_to() -> None:
    env = parallel_env(**IN_METRES)
    for plans, here, observations, _ in flown(env, planner_for(env, "greedy")):
        for agent, plan in plans.items():
            assert plan.shape == (1, 2) and plan == pytest.approx(np.round(plan))
            before, after = (
                np.hypot(*(30 * of[agent][0][:2] - 0.5 - plan[0])) for of in (here, observations)
            )
            assert after < max(before, 1.0)


@pytest.mark.parametrize("name", ["belief"])
def test_drones_on_cells_move_to_the_first_cell_of_their_plan(name: str) -> None:
    env, moved = parallel_env(**ON_CELLS), 0
    assumed = parallel_env(**ON_CELLS | {"probability_of_detection": 0.6})
    for plans, here, observations, _ in flown(env, planner_for(assumed, name, seed=1, **BEAM)):
        for agent, plan in plans.items():
            assert plan[0].tolist() == observations[agent][0].tolist()
            moved += plan[0].tolist() != here[agent][0].tolist()
    assert moved > 10


@pytest.mark.parametrize("name", ["sweep", "effort_allocation"])
def test_a_route_on_cells_is_stated_from_the_next_cell_to_its_end(name: str) -> None:
    env = parallel_env(**ON_CELLS)
    assumed = parallel_env(**ON_CELLS | {"probability_of_detection": 0.6})
    before, shorter = 0, 0
    for plans, *_ in flown(env, planner_for(assumed, name, seed=1)):
        cells = plans["drone0"]
        assert ((cells >= 0) & (cells < 12)).all() and len(cells)
        shorter += len(cells) == before - 1
        before = len(cells)
    assert shorter > 5

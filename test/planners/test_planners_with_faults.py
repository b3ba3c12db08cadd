# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Planners heed the action masks, and what they are given of faults; missions repeat with them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from effort import BEAM, LITTLE_EFFORT
from looking import search_in_vain
from test_batch import alone

from dsse_ros.planners.batch import play_missions
from dsse_ros.planners.belief import BeliefPlanner
from dsse_ros.planners.masking import apply_masks
from dsse_ros.planners.registry import COVERAGE_PLANNERS, PLANNER_NAMES, planner_for
from dsse_ros.search.belief.belief import Belief
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.swarm import Swarm

NAMES = [name for name in PLANNER_NAMES if name not in (*COVERAGE_PLANNERS, "onnx")]
"""Planners that look for persons and need no file."""
SWARM = Swarm.alike(("left", "right", "up", "down", "search"))
SEARCH: dict[str, Any] = {
    "grid_size": 9, "num_drones": 3, "person_initial_position": (6, 6), "timestep_limit": 45,
    "probability_of_detection": 0.2, "battery_move": 4.0, "battery_search": 5.0, "relief_steps": 2,
    "sigma": 2.0,
}  # fmt: skip
FAULTS: dict[str, Any] = {
    "loss_rate": 0.01, "stuck_rate": 0.05, "stuck_steps": 2, "command_drop_rate": 0.1,
    "false_alarm_rate": 0.1, "position_noise": 0.3, "wind_speed": 3.0, "wind_toward": 200.0,
}  # fmt: skip


@pytest.mark.parametrize(
    "fault",
    [
        {"position_noise": 0.8},
        {"position_noise": 0.8, "command_drop_rate": 0.3, "command_delay": 1},
        {"command_drop_rate": 0.3, "stuck_rate": 0.2},
    ],
    ids=lambda fault: ", ".join(fault),
)
def test_a_planner_learns_from_searches_of_cells_that_it_observed_before_and_after_them(
    fault: dict[str, Any],
) -> None:
    env = parallel_env(
        grid_size=9, drones_positions=[(4, 4), (6, 4), (4, 2)], sigma=3.0, vector=(0.2, 0.1),
        collisions=False, pre_search_minutes=2.0, probability_of_detection=0.3,
        person_initial_position=(4, 4), **fault,
    )  # fmt: skip
    planner = planner_for(env, "belief_greedy", learn_drift=False)
    assert isinstance(planner, BeliefPlanner)
    searches = 0
    for seed in range(12):
        observations, infos = env.reset(seed=seed)
        actions = planner(observations, infos)
        assert planner.belief is not None
        expected = Belief(planner.belief.forecast)
        for _ in range(25):
            cells = {agent: tuple(cell.tolist()) for agent, (cell, _) in observations.items()}
            observations, *_, infos = env.step(actions)
            if not env.agents:
                break
            now = {agent: tuple(cell.tolist()) for agent, (cell, _) in observations.items()}
            search = env.rules.action_set.search
            did = [a for a in env.agents if infos[a]["action"] == search and now[a] == cells[a]]
            search_in_vain(expected, [cells[agent] for agent in did])
            expected.advance()
            searches += len(did)
            actions = planner(observations, infos)
            assert planner.belief.poc() == pytest.approx(expected.poc(), abs=1e-12)
    assert searches > 12


def test_an_action_that_a_mask_forbids_is_a_search_or_what_is_left() -> None:
    infos: dict[str, dict[str, Any]] = {
        "drone0": {"action_mask": np.array([1, 0, 1, 1, 1])},
        "drone1": {"action_mask": np.array([0, 0, 0, 1, 0])},
        "drone2": {},
    }
    present = {"drone0": (1, 1), "drone1": (5, 5), "drone2": (0, 1)}
    allowed = {"drone0": 0, "drone1": 3, "drone2": 2}
    assert apply_masks(allowed, present, infos, SWARM) == allowed
    # drone0 stays, so that drone2 may not come.
    chosen = {"drone0": 1, "drone1": 4, "drone2": 1}
    assert apply_masks(chosen, present, infos, SWARM) == {"drone0": 4, "drone1": 3, "drone2": 4}


@pytest.mark.parametrize("name", NAMES)
def test_a_planner_does_nothing_that_the_masks_forbid(name: str) -> None:
    env = parallel_env(**{**SEARCH, "probability_of_detection": 0.0})
    planner = planner_for(env, name, seed=1, **LITTLE_EFFORT.get(name, {}))
    observations, infos = env.reset(seed=4)
    statuses = set()
    while env.agents:
        actions = planner(observations, infos)
        for agent, action in actions.items():
            # One that may only go where it would meet another drone goes home above it.
            assert infos[agent]["action_mask"][action] or action == SWARM.actions.search
        observations, *_, infos = env.step(actions)
        observations = {agent: observations[agent] for agent in env.agents}
        statuses |= {info["status"] for info in infos.values()}
        assert min(info["battery"] for info in infos.values()) >= 20.0 - 1e-6
    assert {"searching", "home"} <= statuses


@pytest.mark.slow
@pytest.mark.parametrize("name", ["greedy", "sweep", "belief"])
def test_missions_with_faults_are_what_single_ones_are(name: str) -> None:
    fields, seeds, options = {**SEARCH, **FAULTS}, range(6), LITTLE_EFFORT.get(name, {})
    env = parallel_env(**fields)
    missions = play_missions(
        len(seeds), name, seed=seeds, planner_seeds=(4, 5), options=options, threads=2, **fields
    )
    for m, seed in enumerate(seeds):
        planner = planner_for(env, name, seed=4 + m % 2, **options)
        assert (missions.found[m], missions.steps[m]) == alone(env, planner, seed, None)


@pytest.mark.parametrize("name", ["greedy", "belief_greedy", "belief"])
@pytest.mark.parametrize(
    "fault",
    [{"wind_speed": 5.0, "wind_toward": 90.0}, {"command_drop_rate": 0.2}, {"stuck_rate": 0.1}],
)
def test_planners_meet_nobody_who_was_held_up(name: str, fault: dict[str, float]) -> None:
    missions = play_missions(
        8, name, seed=3, planner_seeds=range(8), options=LITTLE_EFFORT.get(name, {}), grid_size=9,
        num_drones=4, timestep_limit=30, probability_of_detection=0.2, **fault,
    )  # fmt: skip
    assert missions.collisions.sum() == missions.lost.sum() == 0


def test_the_beam_search_is_on_its_way_home_before_it_has_to_be() -> None:
    env = parallel_env(**{**SEARCH, "relief_steps": 0, "probability_of_detection": 0.0})
    planner = planner_for(env, "belief", seed=1, **BEAM)
    observations, infos = env.reset(seed=4)
    wanted: dict[str, int] = {}
    while env.agents:
        actions = planner(observations, infos)
        for agent in actions:
            info = infos[agent]
            # Home is on the edge in the north: the plan alone has come closer to it by then.
            if info["status"] == "searching" and info["action_mask"].sum() <= 2:
                wanted[agent] = actions[agent]
        observations, *_, infos = env.step(actions)
        observations = {agent: observations[agent] for agent in env.agents}
    assert (env.world.faults and env.world.faults.conditions["battery"] >= 20.0 - 1e-6).all()
    assert wanted

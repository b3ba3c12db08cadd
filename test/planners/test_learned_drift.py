# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planners on a belief learn the drift from the observed map."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from effort import LITTLE_EFFORT

from dsse_ros.planners.registry import PERSON_PLANNERS, planner_for
from dsse_ros.search.belief.drift_estimate import FIRST_OBSERVED
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.probable_cells import most_probable

V2: dict[str, Any] = {
    "rules": "v2", "grid_size": 30, "dispersion_inc": 0.05, "vector": (1.1, 1.0),
    "person_initial_position": (12, 13),
}  # fmt: skip
PAPER: dict[str, Any] = {
    "grid_size": 30, "sigma": 3, "vector": (-0.12, 0.15), "person_initial_position": (14, 13),
}  # fmt: skip
CASES = {"v2": V2, "paper": PAPER, "v1": {**PAPER, "rules": "v1"}}
# Factors on the drift along x and y that are assumed.
WRONG = {
    "x": (1.5, 1.0), "y": (1.0, 0.6), "both": (0.7, 1.4), "faster": (1.3, 1.3),
    "slower": (0.6, 0.6), "none": (0.0, 0.0), "back": (-1.0, -1.0),
}  # fmt: skip


def sea(case: str, **fields: Any) -> SearchEnv:
    """Return an environment in which nobody is found."""
    fields = {"timestep_limit": 60, **CASES[case], "num_drones": 2, **fields}
    return parallel_env(**fields, probability_of_detection=0.0)


def misled(env: SearchEnv, factors: tuple[float, float]) -> SearchDefinition:
    """Return what a planner may know, with another drift than that of the environment."""
    x, y = env.scenario.vector
    scenario = env.scenario.override(vector=(factors[0] * x, factors[1] * y))
    return SearchDefinition(env.rules, scenario)


def steps(env: SearchEnv, planner: Any) -> Iterator[tuple[dict[str, int], Any]]:
    """Play a mission; yields each step's actions and the map that they were chosen on."""
    observations, infos = env.reset(seed=1)
    while env.agents:
        probability = observations["drone0"][1]
        actions = planner(observations, infos)
        yield actions, probability
        observations, _, _, _, infos = env.step(actions)


def foresees(planner: Any, probability: Any) -> bool:
    """Return whether the map is the one that the planner expects at its step."""
    forecast = planner.belief.forecast
    done = forecast.first_step + planner.belief.step
    datum = most_probable(probability, 1)[0]
    return done < FIRST_OBSERVED or forecast.most_probable(done) == datum


@pytest.mark.slow
@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("case", CASES)
def test_the_expected_map_is_the_observed_one_whatever_drift_was_assumed(
    case: str, wrong: str
) -> None:
    env = sea(case)
    planner = planner_for(misled(env, WRONG[wrong]), "belief_greedy")
    assert all(foresees(planner, probability) for _, probability in steps(env, planner))


@pytest.mark.slow
@pytest.mark.parametrize("start", [(9, 8), (1, 9), (2, 10)])
@pytest.mark.parametrize("case", CASES)
def test_so_it_is_when_the_datum_has_come_to_the_grids_edge(
    case: str, start: tuple[int, int]
) -> None:
    # Where a step would lead out the datum stays, so that drifts of no one range explain its cells.
    env = sea(case, grid_size=12, person_initial_position=start)
    for wrong in ("faster", "slower", "both"):
        planner = planner_for(misled(env, WRONG[wrong]), "belief_greedy")
        assert all(foresees(planner, probability) for _, probability in steps(env, planner)), wrong
        datum = env.world.worlds[["datum_x", "datum_y"]][0].tolist()
        assert {0, 11} & set(datum)


@pytest.mark.slow
@pytest.mark.parametrize("wrong", WRONG)
def test_the_learned_drift_is_the_true_one(wrong: str) -> None:
    # The datum's last cell leaves one cell in 60 steps open; v1 loses what it does not move by.
    for case in ("v2", "paper"):
        env = sea(case)
        planner: Any = planner_for(misled(env, WRONG[wrong]), "belief_greedy")
        for _ in steps(env, planner):
            pass
        learned, true = planner.belief.forecast.scenario.vector, env.scenario.vector
        assert np.abs(np.subtract(learned, true)).max() < 0.1 * np.hypot(*true), case


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", PERSON_PLANNERS)
def test_the_right_drift_changes_no_decision(name: str, case: str) -> None:
    options = LITTLE_EFFORT.get(name, {})
    env = sea(case, timestep_limit=30)
    played = [
        [actions for actions, _ in steps(env, planner)]
        for planner in (planner_for(env, name, learn_drift=x, **options) for x in (True, False))
    ]
    assert played[0] == played[1]


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_searches_so_far_are_kept_when_the_drift_is_learned(case: str) -> None:
    env = sea(case, timestep_limit=40)
    planner: Any = planner_for(misled(env, (0.6, 0.6)), "belief_greedy")
    for _ in steps(env, planner):
        pass
    learned = SearchDefinition(env.rules, planner.belief.forecast.scenario)
    informed: Any = planner_for(learned, "belief_greedy", learn_drift=False)
    again: Any = planner_for(misled(env, (0.6, 0.6)), "belief_greedy")
    observations, infos = env.reset(seed=1)
    while env.agents:
        actions = again(observations, infos)
        informed(observations, infos)
        observations, _, _, _, infos = env.step(actions)
        infos = {a: {**infos[a], "action": actions[a], "step": env.steps_done} for a in infos}
    assert np.array_equal(informed.belief.poc(), planner.belief.poc())


@pytest.mark.parametrize("name", PERSON_PLANNERS)
def test_nothing_is_learned_from_an_observed_belief(name: str) -> None:
    env = sea("v2", timestep_limit=20, observe="belief")
    planner: Any = planner_for(env, name, **LITTLE_EFFORT.get(name, {}))
    for _ in steps(env, planner):
        pass
    assert planner.belief.forecast.scenario.vector == env.scenario.vector

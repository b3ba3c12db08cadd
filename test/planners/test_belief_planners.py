# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planners on a belief: what they may know, what they find, and that they keep the rules."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from effort import BEAM, LITTLE_EFFORT

from dsse_ros.planners.batch import play_missions
from dsse_ros.planners.registry import PERSON_PLANNERS, PLANNER_NAMES, make_planner, planner_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.definition import SearchDefinition

NAMES = [name for name in PLANNER_NAMES if name not in ("onnx", "astar")]
"""Planners that need no file."""
V2: dict[str, Any] = {
    "rules": "v2", "grid_size": 20, "drones_positions": [(10, 0), (10, 19), (0, 10), (19, 10)],
    "person_initial_position": (10, 10), "dispersion_inc": 0.05, "timestep_limit": 60,
}  # fmt: skip
PAPER: dict[str, Any] = {
    "grid_size": 10, "num_drones": 3, "sigma": 2, "vector": (0.1, 0.05), "timestep_limit": 40,
    "person_initial_position": (4, 5),
}  # fmt: skip
CASES = {"v2": V2, "paper": PAPER, "v1": {**PAPER, "rules": "v1"}}


def play(env: SearchEnv, planner: Any, seed: int, **reset: Any) -> tuple[list[list[int]], bool]:
    """Return the actions of every step, and whether everybody was found."""
    observations, infos = env.reset(seed=seed, **reset)
    chosen, found = [], False
    while env.agents:
        actions = planner(observations, infos)
        chosen.append(list(actions.values()))
        observations, _, _, _, infos = env.step(actions)
        observations = {agent: observations[agent] for agent in env.agents}
        found = any(info["Found"] for info in infos.values())
    return chosen, found


@pytest.mark.parametrize("name", NAMES)
def test_every_planner_is_made_for_an_environment_and_plays_a_mission(name: str) -> None:
    env = parallel_env(**PAPER)
    chosen, _ = play(env, planner_for(env, name, seed=1), 3)
    assert chosen


def test_an_unknown_planner_is_refused_in_one_line_that_lists_the_known_ones() -> None:
    env = parallel_env(**PAPER)
    with pytest.raises(ValueError, match="'beleif'") as refusal:
        planner_for(env, "beleif")
    assert "\n" not in str(refusal.value)
    assert all(name in str(refusal.value) for name in PLANNER_NAMES)


@pytest.mark.parametrize("name", PERSON_PLANNERS)
def test_a_planner_that_needs_the_search_is_not_made_of_actions_alone(name: str) -> None:
    with pytest.raises(ValueError, match="rules and the scenario"):
        make_planner(name, parallel_env(**PAPER).rules.actions)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", PERSON_PLANNERS)
def test_rules_scenario_and_observations_are_all_that_a_planner_needs(name: str, case: str) -> None:
    env = parallel_env(**CASES[case], probability_of_detection=0.0)
    public = SearchDefinition(env.rules, env.scenario)
    planners = [
        planner_for(search, name, seed=2, **LITTLE_EFFORT.get(name, {})) for search in (env, public)
    ]
    assert play(env, planners[0], 5) == play(env, planners[1], 5)


@pytest.mark.slow
@pytest.mark.parametrize("name", PERSON_PLANNERS)
def test_where_the_person_is_hidden_changes_nothing_before_it_is_found(name: str) -> None:
    env = parallel_env(**V2)
    planner = planner_for(env, name, seed=2, **LITTLE_EFFORT.get(name, {}))
    played = [play(env, planner, seed)[0] for seed in range(3)]
    shortest = min(len(steps) for steps in played)
    assert all(steps[:shortest] == played[0][:shortest] for steps in played)


@pytest.mark.slow
@pytest.mark.parametrize("name", PERSON_PLANNERS)
def test_a_new_mission_starts_anew_and_the_same_seed_gives_the_same_mission(name: str) -> None:
    env = parallel_env(**V2, probability_of_detection=0.0)
    planner = planner_for(env, name, seed=2, **LITTLE_EFFORT.get(name, {}))
    first = play(env, planner, 1)
    play(env, planner, 2, options={"vector": (0.3, -0.2), "person_initial_position": (6, 12)})
    assert play(env, planner, 1) == first
    assert play(env, planner_for(env, name, seed=2, **LITTLE_EFFORT.get(name, {})), 1) == first


def test_a_planner_knows_the_drift_that_a_reset_was_given() -> None:
    env = parallel_env(**V2, probability_of_detection=0.0)
    planner = planner_for(env, "belief_greedy")
    play(env, planner, 1, options={"vector": (-0.6, 0.4)})
    other = parallel_env(**V2, probability_of_detection=0.0, vector=(-0.6, 0.4))
    direct: Any = planner_for(other, "belief_greedy")
    play(other, direct, 1)
    assert np.array_equal(planner.belief.poc(), direct.belief.poc())  # type: ignore[attr-defined]


@pytest.mark.slow
@pytest.mark.parametrize("name", PERSON_PLANNERS)
@pytest.mark.parametrize("num_drones", [1, 2, 7, 30, 64])
def test_no_drone_collides_or_leaves_the_grid(name: str, num_drones: int) -> None:
    env = parallel_env(
        grid_size=8, num_drones=num_drones, vector=(0.3, -0.2), timestep_limit=25,
        person_initial_position=(6, 5), probability_of_detection=0.3,
    )  # fmt: skip
    planner = planner_for(env, name, seed=1, **LITTLE_EFFORT.get(name, {}))
    observations, infos = env.reset(seed=num_drones)
    while env.agents:
        agents = list(env.agents)
        assert len(agents) == num_drones
        observations, _, terminated, truncated, infos = env.step(planner(observations, infos))
        ended = [agent for agent in agents if terminated[agent] or truncated[agent]]
        assert all(truncated[agent] or infos[agent]["Found"] for agent in ended)
        observations = {agent: observations[agent] for agent in env.agents}


@pytest.mark.parametrize("name", PERSON_PLANNERS)
def test_the_others_go_on_when_a_drone_is_lost(name: str) -> None:
    env = parallel_env(**PAPER, probability_of_detection=0.0)
    planner = planner_for(env, name, **LITTLE_EFFORT.get(name, {}))
    observations, infos = env.reset(seed=1)
    for step in range(20):
        if step == 8:
            env.withdraw(1)
        observations, _, _, _, infos = env.step(planner(observations, infos))
        observations = {agent: observations[agent] for agent in env.agents}
    assert list(observations) == ["drone0", "drone2"]


def test_without_drones_there_are_no_actions() -> None:
    env = parallel_env(**PAPER)
    assert all(planner_for(env, name)({}, {}) == {} for name in PERSON_PLANNERS)


def test_a_budget_that_is_used_up_leaves_moves_that_do_not_collide() -> None:
    env = parallel_env(**{**PAPER, "num_drones": 9}, probability_of_detection=0.0)
    chosen, _ = play(env, planner_for(env, "belief", **BEAM, budget_ms=0.0), 1)
    assert all(len(actions) == 9 for actions in chosen)


@pytest.mark.slow
def test_the_time_that_infos_give_a_decision_is_a_budget_too() -> None:
    env = parallel_env(**{**PAPER, "num_drones": 9}, probability_of_detection=0.0)
    limited = planner_for(env, "belief", **BEAM)

    def planner(observations: Any, infos: Any) -> dict[str, int]:
        limited_infos = {agent: {**info, "decision_time_s": 0.0} for agent, info in infos.items()}
        return limited(observations, limited_infos)

    without = planner_for(env, "belief", **BEAM, budget_ms=0.0)
    assert play(env, planner, 1) == play(env, without, 1)
    assert play(env, planner, 1) != play(env, planner_for(env, "belief", **BEAM), 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", PERSON_PLANNERS)
def test_a_find_is_no_failed_search_while_others_are_missing(name: str) -> None:
    env = parallel_env(**V2, person_amount=3)
    planner: Any = planner_for(env, name, **LITTLE_EFFORT.get(name, {}))
    informed: Any = planner_for(env, name, **LITTLE_EFFORT.get(name, {}))
    observations, infos = env.reset(seed=3)
    finds = 0
    while not finds:
        actions = planner(observations, infos)
        informed(observations, infos)
        observations, _, _, _, infos = env.step(actions)
        finds = sum(info["found_person"] for info in infos.values())
    assert not any(info["Found"] for info in infos.values())
    planner(observations, infos)
    informed(observations, {a: {**info, "found_person": False} for a, info in infos.items()})
    found = [env.world.drones["x"][0], env.world.drones["y"][0]]
    cells = [(x, y) for x, y, f in zip(*found, env.world.found[0], strict=True) if f]
    for x, y in cells:
        assert planner.belief.poc()[y, x] > informed.belief.poc()[y, x]


@pytest.mark.parametrize(
    "planner", [pytest.param("belief", marks=pytest.mark.slow), "belief_greedy"]
)
def test_a_belief_finds_sooner_than_the_map_alone(planner: str) -> None:
    # The standard errors of the means are below 2 steps, the means about ten steps apart.
    count, limit = 100, V2["timestep_limit"]
    missions = play_missions(count, planner, seed=7000, **V2)
    env = parallel_env(**V2)
    greedy = planner_for(env, "greedy")
    lengths = [
        len(chosen) if found else limit
        for chosen, found in (play(env, greedy, 7000 + m) for m in range(count))
    ]
    assert missions.steps.mean() + 5 < np.mean(lengths)
    assert missions.found.mean() > 0.97

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions that share a planner are what single ones are."""

from __future__ import annotations

from typing import Any

import pytest
from effort import LITTLE_EFFORT

from dsse_ros.planners import PLANNER_NAMES, Planner, planner_for
from dsse_ros.planners.batch import play_missions
from dsse_ros.search import FieldError, SearchDefinition, SearchEnv, parallel_env

NAMES = [name for name in PLANNER_NAMES if name not in ("onnx", "astar")]
"""Planners that need no file."""
PAPER: dict[str, Any] = {"grid_size": 8, "num_drones": 2, "sigma": 2, "timestep_limit": 30}
V2: dict[str, Any] = {
    "rules": "v2", "grid_size": 12, "num_drones": 2, "person_initial_position": (6, 5),
    "timestep_limit": 30,
}  # fmt: skip
CASES: dict[str, dict[str, Any]] = {
    "paper": PAPER, "v1": {**PAPER, "rules": "v1"}, "v2": V2, "several": {**V2, "person_amount": 2},
}  # fmt: skip
SEEDS = range(70, 76)


def alone(env: SearchEnv, planner: Planner, seed: int, lost: int | None) -> tuple[bool, int]:
    """Play one mission; returns whether all were found, and the steps."""
    observations, infos = env.reset(seed=seed)
    steps, limit = 0, env.scenario.timestep_limit
    while env.agents and steps < limit:
        observations, _, _, _, infos = env.step(planner(observations, infos))
        observations = {agent: observations[agent] for agent in env.agents}
        steps += 1
        if steps == lost:
            env.withdraw(env.scenario.num_drones - 1)
    found = bool(env.world.worlds["num_missing"][0] == 0) and not env.agents
    return found, steps if found else limit


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["greedy", "random", "expanding_square", "belief_greedy", "belief", "forward_backward"],
)
@pytest.mark.parametrize(
    ("case", "lost"), [("paper", None), ("paper", 5), ("v1", None), ("v2", 5), ("several", None)]
)
def test_missions_that_share_a_planner_are_what_single_ones_are(
    name: str, case: str, lost: int | None
) -> None:
    env = parallel_env(**CASES[case])
    options = LITTLE_EFFORT.get(name, {})
    missions = play_missions(
        len(SEEDS), name, seed=SEEDS, planner_seeds=(4, 5), options=options, withdraw_at=lost,
        threads=2, **CASES[case],
    )  # fmt: skip
    for m, seed in enumerate(SEEDS):
        planner = planner_for(env, name, seed=4 + m % 2, **options)
        assert (missions.found[m], missions.steps[m]) == alone(env, planner, seed, lost)


CROWDED: dict[str, Any] = {"grid_size": 5, "num_drones": 4, "sigma": 2, "timestep_limit": 40}
"""Drones are in one another's way, so that routes are left at random."""


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("case", ["crowded", "v2", "several"])
def test_each_mission_has_a_planner_of_its_own_seed_by_default(name: str, case: str) -> None:
    fields = CROWDED if case == "crowded" else CASES[case]
    env, options = parallel_env(**fields), LITTLE_EFFORT.get(name, {})
    missions = play_missions(len(SEEDS), name, seed=SEEDS, options=options, threads=2, **fields)
    for m, seed in enumerate(SEEDS):
        planner = planner_for(env, name, seed=seed, **options)
        assert (missions.found[m], missions.steps[m]) == alone(env, planner, seed, None)
        assert missions.planner_seeds[m] == (seed if getattr(planner, "drawn", True) else -1)


def test_seeds_of_planners_that_draw_nothing_do_not_count() -> None:
    for name in ("greedy", "belief_greedy"):
        assert (play_missions(5, name, seed=SEEDS[0], **PAPER).planner_seeds == -1).all()
    assert play_missions(5, "random", seed=SEEDS[0], **PAPER).planner_seeds.tolist() == [*SEEDS[:5]]
    played = play_missions(5, "random", seed=SEEDS[0], planner_seeds=(4, 5), **PAPER)
    assert played.planner_seeds.tolist() == [4, 5, 4, 5, 4]


def test_a_planner_that_cannot_be_shared_is_made_for_each_seed() -> None:
    made = []

    def make(search: SearchDefinition, *, seed: int) -> Planner:
        made.append(seed)
        return lambda observations, infos: dict.fromkeys(observations, 4)

    missions = play_missions(6, make, seed=SEEDS[0], planner_seeds=(8, 9, 10), **PAPER)
    assert set(made[1:]) == {8, 9, 10}
    assert missions.planner_seeds.tolist() == [8, 9, 10, 8, 9, 10]


@pytest.mark.parametrize("name", NAMES)
def test_every_planner_plays_missions(name: str) -> None:
    missions = play_missions(5, name, seed=SEEDS[0], options=LITTLE_EFFORT.get(name), **PAPER)
    assert (missions.steps[missions.found] <= 30).all()
    assert (missions.steps[~missions.found] == 30).all()
    assert not missions.lost.any()


def test_planners_may_be_given_another_scenario_than_the_one_that_is_played() -> None:
    env = parallel_env(**V2, vector=(0.8, 0.6))
    assumed = env.scenario.override(vector=(-0.5, 0.9))
    missions = play_missions(
        len(SEEDS), "belief_greedy", env.scenario, rules=env.rules, seed=SEEDS, assumed=assumed
    )
    for m, seed in enumerate(SEEDS):
        planner = planner_for(SearchDefinition(env.rules, assumed), "belief_greedy")
        assert (missions.found[m], missions.steps[m]) == alone(env, planner, seed, None)


def test_a_drone_that_is_withdrawn_counts_as_lost() -> None:
    missions = play_missions(20, "sweep", withdraw_at=3, **PAPER)
    assert (missions.lost == ~missions.found).all() and not missions.found.all()


def test_an_unknown_planner_is_refused() -> None:
    with pytest.raises(FieldError, match="planner must be one of .*, got 'beleif'"):
        play_missions(5, "beleif", **PAPER)

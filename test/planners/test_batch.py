# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions that share a planner are what single ones are."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from effort import LITTLE_EFFORT

from dsse_ros.base.fields import FieldError
from dsse_ros.planners.batch import play_missions
from dsse_ros.planners.planner import Planner
from dsse_ros.planners.play import play
from dsse_ros.planners.registry import PLANNER_NAMES, planner_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.definition import SearchDefinition

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
    for _ in play(env, planner, seed=seed):
        if env.steps_done == lost:
            env.withdraw(env.scenario.num_drones - 1)
    found = bool(env.world.worlds["num_missing"][0] == 0)
    return found, env.steps_done if found else env.scenario.timestep_limit


def measured(env: SearchEnv, planner: Planner, seed: int) -> tuple[bool, int, int, float, int]:
    """Play one mission; returns what `PlayedMissions` has of it, by its definitions."""
    limit, out, path, meetings = env.scenario.timestep_limit, set[str](), 0.0, 0
    last = env.rules.last_step(limit)
    before = np.array(env.scenario.drones_positions)
    for step in play(env, planner, seed=seed):
        now = np.stack([env.world.drones["x"][0], env.world.drones["y"][0]], axis=1)
        flown = [env.possible_agents.index(agent) for agent in step.actions]
        path += float(np.hypot(*(now - before)[flown].T).sum())
        cells = [tuple(now[n]) for n in flown if not env.world.drones["cannot_collide"][0, n]]
        if env.steps_done <= env.rules.last_acting_step(limit):
            meetings += sum(a == b for a, b in itertools.combinations(cells, 2))
        before = now
        if env.steps_done <= last:
            out |= {agent for agent, ended in step.terminations.items() if ended}
    found, steps = bool(env.world.worlds["num_missing"][0] == 0), env.steps_done
    path *= env.scenario.cell_size
    return found, steps if found else limit, 0 if found else len(out), path, meetings


LOSSES: dict[str, dict[str, Any]] = {
    "none": {}, "lost": {"loss_rate": 0.03}, "noisy": {"position_noise": 0.7, "stuck_rate": 0.1},
    "battery": {"battery_move": 4.0},
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("faults", LOSSES)
@pytest.mark.parametrize("rules", ["paper", "v1", "v2", "coverage"])
@pytest.mark.parametrize("name", ["greedy", "random", "sweep", "belief_greedy"])
def test_missions_are_those_of_the_environment_in_all_that_is_counted(
    name: str, rules: str, faults: str
) -> None:
    if rules == "coverage" and name == "belief_greedy":
        pytest.skip("it looks for persons")
    fields = {**PAPER, "num_drones": 3, "rules": rules, **LOSSES[faults]}
    env, seeds = parallel_env(**fields), range(20)
    missions = play_missions(len(seeds), name, seed=seeds, **fields)
    for m, seed in enumerate(seeds):
        found, steps, lost, path, meetings = measured(env, planner_for(env, name, seed=seed), seed)
        assert (missions.found[m], missions.steps[m], missions.lost[m]) == (found, steps, lost)
        assert missions.path_length_m[m] == pytest.approx(path)
        assert missions.collisions[m] == meetings


def test_finds_after_the_time_limit_count_where_the_rules_let_drones_act_then() -> None:
    fields = {**PAPER, "rules": "v1", "timestep_limit": 6, "probability_of_detection": 0.3}
    played = play_missions(300, "greedy", seed=0, **fields)
    env = parallel_env(**fields)
    found = [alone(env, planner_for(env, "greedy"), seed, None) for seed in range(300)]
    assert [*zip(played.found, played.steps, strict=True)] == found
    assert (played.steps > 6).any()


@pytest.mark.parametrize("kind", [np.int64, np.uint8, np.int16])
def test_a_seed_of_numpy_is_that_of_python(kind: type) -> None:
    for given in ({"seed": 5}, {"seed": range(5, 9)}, {"planner_seeds": [3, 4]}):
        of_numpy = {
            k: kind(v) if isinstance(v, int) else np.array(v, kind) for k, v in given.items()
        }
        ours, theirs = (
            vars(play_missions(4, "random", **seeds, **PAPER)) for seeds in (given, of_numpy)
        )
        for name, values in ours.items():
            assert np.array_equal(values, theirs[name])


@pytest.mark.parametrize(
    ("seeds", "line"),
    [
        ({"seed": -1}, "seed must be an integer >= 0, got -1"),
        ({"seed": 1.5}, "seed must be an integer >= 0, got 1.5"),
        ({"seed": [1, 2]}, "seed must be one number for each of 3 missions, got 2"),
        ({"seed": [1, 2, -3]}, "seed must be an integer >= 0, got -3"),
        ({"planner_seeds": []}, "planner_seeds must be one or more, got none"),
        ({"planner_seeds": [1, "2"]}, "seed must be an integer >= 0, got '2'"),
    ],
)
def test_seeds_that_are_none_are_refused(seeds: dict[str, Any], line: str) -> None:
    with pytest.raises(FieldError, match=f"^{line}"):
        play_missions(3, "random", **seeds, **PAPER)


@pytest.mark.parametrize("answer", [{}, {"drone0": 4}, {"drone0": 4, "drone1": 77}])
def test_an_answer_that_the_environment_refuses_is_refused(answer: dict[str, int]) -> None:
    env = parallel_env(**PAPER)
    with pytest.raises(FieldError) as of_env:
        list(play(env, lambda observations, infos: answer, seed=1))
    with pytest.raises(FieldError) as of_batch:
        play_missions(3, lambda search, seed: lambda observations, infos: answer, seed=1, **PAPER)
    assert str(of_env.value) == str(of_batch.value)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["greedy", "random", "expanding_square", "belief_greedy", "belief"],
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
        len(SEEDS), name, seed=SEEDS, planner_seeds=(4, 5), options=options, threads=2,
        loss_steps=None if lost is None else (0, lost + 1), **CASES[case],
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
    assumed = SearchDefinition(env.rules, env.scenario.override(vector=(-0.5, 0.9)))
    missions = play_missions(
        len(SEEDS), lambda _, *, seed: planner_for(assumed, "belief_greedy", seed=seed),
        env.scenario, rules=env.rules, seed=SEEDS,
    )  # fmt: skip
    for m, seed in enumerate(SEEDS):
        planner = planner_for(assumed, "belief_greedy")
        assert (missions.found[m], missions.steps[m]) == alone(env, planner, seed, None)


def test_a_drone_that_drops_out_counts_as_lost() -> None:
    missions = play_missions(20, "sweep", loss_steps=(0, 4), **PAPER)
    assert (missions.lost == ~missions.found).all() and not missions.found.all()


def test_an_unknown_planner_is_refused() -> None:
    with pytest.raises(FieldError, match="planner must be one of .*, got 'beleif'"):
        play_missions(5, "beleif", **PAPER)

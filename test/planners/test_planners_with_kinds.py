# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Planners fly swarms of drones of different kinds: nobody meets anybody, or leaves the grid."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from areas import CELL_M, ORIGIN, geojson_of
from effort import LITTLE_EFFORT
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from test_batch import alone

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.batch import play_missions
from dsse_ros.planners.masking import keep_apart
from dsse_ros.planners.plan_kernels import PlannedFleet, looks_of_plans
from dsse_ros.planners.play import play
from dsse_ros.planners.registry import PERSON_PLANNERS, PLANNERS, planner_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.actions import DIAGONAL, ActionSet
from dsse_ros.world.searchers.registry import SEARCHERS
from dsse_ros.world.searchers.searcher import Searcher

KINDS = {
    "slow": Searcher(doc="takes three steps for a cell", speed=4.0),
    "straight": Searcher(
        doc="flies straight on, for a while", speed=7.0, endurance_min=5.0,
        moves=("left", "right", "up", "down"),
    ),
    "halting": Searcher(doc="goes to the east alone", moves=("right",)),
    "rook": Searcher(doc="flies straight", moves=("left", "right", "up", "down")),
    "seven": Searcher(
        doc="lacks a diagonal",
        moves=("left", "right", "up", "down", "up_left", "up_right", "down_left"),
    ),
    "bishop": Searcher(doc="flies diagonally", moves=DIAGONAL),
    "never_back": Searcher(doc="flies to the south-east", moves=("right", "down")),
}  # fmt: skip
SWARM = ("drone", "slow", "straight", "slow", "halting", "drone")
SEARCH: dict[str, Any] = {
    "grid_size": 7, "num_drones": 6, "searchers": SWARM, "person_initial_position": (4, 4),
    "timestep_limit": 60, "probability_of_detection": 0.0, "sigma": 2.0,
}  # fmt: skip
FOR_PERSONS = sorted({*PLANNERS, *PERSON_PLANNERS, "onnx"})


@pytest.fixture(autouse=True)
def kinds(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, kind in KINDS.items():
        monkeypatch.setitem(SEARCHERS, name, kind)


def fly(env: SearchEnv, name: str, seed: int, **options: Any) -> list[list[list[int]]]:
    """Return the cells of a mission; no two drones in the search are in one, nor off the grid."""
    planner = planner_for(env, name, seed=seed, **options)
    observations, infos = env.reset(seed=seed)
    cells = []
    while env.agents:
        actions = planner(observations, infos)
        assert actions.keys() == observations.keys()
        observations, _, terminated, truncated, infos = env.step(actions)
        for agent in terminated:
            # But for the end of all, a drone ends by its endurance only.
            ended = terminated[agent] and not truncated[agent]
            assert not ended or infos[agent]["status"] == "home" or infos[agent]["Found"]
        observations = {agent: observations[agent] for agent in env.agents}
        flying = [a for a in env.agents if infos[a]["status"] != "home"]
        places = [observations[agent][0].tolist() for agent in flying]
        assert len({tuple(place) for place in places}) == len(places)
        assert all(env.scenario.grid_size.holds(*place) for place in places)
        cells.append(places)
    return cells


@pytest.mark.slow
@pytest.mark.parametrize("name", FOR_PERSONS)
@pytest.mark.parametrize("rules", ["paper", "v2"])
def test_a_planner_flies_a_mix_of_kinds_without_a_collision(name: str, rules: str) -> None:
    if name == "onnx" and rules == "paper":
        pytest.skip("the model is one of v2")
    for seed in range(3):
        # The model refuses a POD below .5, so its missions can end with a find.
        pod = {"probability_of_detection": 0.5} if name == "onnx" else {}
        cells = fly(
            parallel_env({**SEARCH, **pod}, rules=rules), name, seed, **LITTLE_EFFORT.get(name, {})
        )
        assert len(cells) >= 60 or pod


@pytest.mark.parametrize("name", ["astar", "sweep", "spiral"])
def test_planners_cover_with_a_mix_of_kinds_without_a_collision(name: str) -> None:
    matrix = np.random.default_rng(1).random((7, 7))
    task: dict[str, Any] = {"rules": "coverage", "probability_matrix": matrix}
    fly(parallel_env(searchers=SWARM, num_drones=6, timestep_limit=100, **task), name, 1)
    swarm = ("slow", "drone", "drone", "slow")
    env = parallel_env(searchers=swarm, num_drones=4, timestep_limit=300, **task)
    fly(env, name, 1)
    # They get on: nobody waits forever for somebody who waits for them.
    assert env.world.coverage_metrics()["coverage_rate"][0] == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("in_area", [False, True], ids=["grid", "area"])
@pytest.mark.parametrize("kind", ["rook", "seven", "bishop", "never_back"])
@pytest.mark.parametrize("name", [*FOR_PERSONS, "astar"])
def test_a_planner_commands_each_drone_what_its_kind_can_do_and_none_stands_still(
    name: str, kind: str, in_area: bool
) -> None:
    swarm = (kind, "drone", kind)
    fields: dict[str, Any] = {
        "grid_size": 9, "searchers": swarm, "drones_positions": [(0, 0), (8, 8), (1, 1)],
        "timestep_limit": 60,
    }  # fmt: skip
    if name == "astar":
        fields |= {"rules": "coverage", "probability_matrix": np.ones((9, 9))}
    else:
        # Persons are hard to find, but not impossible: then there would be nothing to plan for.
        fields |= {
            "rules": "v2",
            "person_initial_position": (4, 4),
            "probability_of_detection": 0.5 if name == "onnx" else 0.01,
        }
    if in_area:
        mask = np.ones((9, 9), bool)
        mask[3, 2:7] = mask[6, 6] = False
        fields |= {"area": geojson_of(mask), "cell_size": CELL_M}
        fields |= {"origin_lat": ORIGIN[0], "origin_lon": ORIGIN[1]}
    env = parallel_env(**fields)
    planner = planner_for(env, name, seed=1, **LITTLE_EFFORT.get(name, {}))
    _, infos = env.reset(seed=3)
    visited: dict[str, set[tuple[int, ...]]] = {agent: set() for agent in env.agents}
    for step in play(env, planner, seed=3):
        for agent, action in step.actions.items():
            assert infos[agent]["action_mask"][action], (agent, action)
        for agent, (cell, _) in step.observations.items():
            visited[agent].add(tuple(cell.tolist()))
        infos = step.infos
    # The model was trained with a POD of 1, and so hardly with cells to search again and again.
    if env.steps_done >= 40 and name != "onnx":
        assert min(map(len, visited.values())) >= 4, visited


@pytest.mark.parametrize("name", ["greedy", "sweep", "belief"])
def test_missions_with_kinds_are_what_single_ones_are(name: str) -> None:
    seeds, options = range(4), LITTLE_EFFORT.get(name, {})
    fields = {**SEARCH, "probability_of_detection": 0.5}
    env = parallel_env(fields)
    missions = play_missions(
        len(seeds), name, fields, seed=seeds, planner_seeds=(4, 5), options=options, threads=2
    )
    assert missions.collisions.sum() == 0
    for m, seed in enumerate(seeds):
        planner = planner_for(env, name, seed=4 + m % 2, **options)
        assert (missions.found[m], missions.steps[m]) == alone(env, planner, seed, None)


def test_a_sweep_with_slow_drones_searches_all_of_the_grid() -> None:
    env = parallel_env(
        grid_size=6, num_drones=4, searchers=("slow", "drone", "drone", "slow"),
        probability_of_detection=0.0, timestep_limit=300,
    )  # fmt: skip
    planner = planner_for(env, "sweep", seed=1)
    observations, infos = env.reset(seed=1)
    searched = set()
    while env.agents:
        cells = {agent: tuple(cell.tolist()) for agent, (cell, _) in observations.items()}
        observations, *_, infos = env.step(planner(observations, infos))
        searched |= {cells[a] for a in infos if infos[a]["action"] == env.rules.action_set.search}
        observations = {agent: observations[agent] for agent in env.agents}
    assert len(searched) == 36


def test_nobody_goes_where_another_drone_is_or_is_under_way_to() -> None:
    actions = ActionSet(("left", "right", "up", "down", "search"))
    present = {"drone0": (0, 0), "drone1": (2, 0), "drone2": (3, 0), "drone3": (5, 5)}
    infos: dict[str, dict[str, Any]] = {
        "drone1": {"status": "under_way", "action_mask": np.array([1, 0, 0, 0, 0], np.int8)}
    }
    chosen = {"drone0": 1, "drone1": 4, "drone2": 0, "drone3": 2}
    # drone1 is under way to (1, 0), where drone0 wants to go, and in (2, 0), where drone2 does.
    assert keep_apart(chosen, present, infos, actions) == {
        "drone0": 4, "drone1": 0, "drone2": 4, "drone3": 2,
    }  # fmt: skip


def looks_of(
    fleet: PlannedFleet, paths: NDArray[np.int64], lengths: NDArray[np.int64]
) -> list[list[tuple[int, int]]]:
    """Return the steps and columns of the looks of each plan."""
    first, looks = np.empty(len(paths) + 1, np.int64), np.empty((3, paths.size), np.int64)
    looks_of_plans(fleet, paths, lengths, first, looks)
    return [
        [(int(step), int(column)) for step, column in looks[:2, start:end].T]
        for start, end in pairwise(first)
    ]


def test_the_looks_of_plans_come_at_the_times_of_each_kind() -> None:
    side, horizon = 12, 4
    # Two drones fly to the east; a move takes the second kind three steps.
    extra = np.array([[0.0, 0.0], [0.0, 2.0]])
    fleet = PlannedFleet(
        np.array([0, 1]), np.array([0, 1]), np.array([[0, 1, 2], [0, 1, 2]]),
        np.zeros((2, 2), np.int64), extra, np.zeros((2, 2)), GridShape.square(side),
    )  # fmt: skip
    paths = np.add.outer(side * np.array([4, 6]) + 3, np.arange(horizon + 1))[None]
    lengths = np.full((1, 2), horizon)
    assert looks_of(fleet, np.tile(paths, (2, 1, 1)), np.tile(lengths, (2, 1))) == 2 * [
        [(0, paths[0, 0, 1]), (1, paths[0, 0, 2]), (2, paths[0, 0, 3]), (2, paths[0, 1, 1]),
         (3, paths[0, 0, 4])]
    ]  # fmt: skip


@settings(max_examples=50, deadline=None)
@given(st.lists(st.booleans(), min_size=1, max_size=20))
def test_a_plan_looks_in_the_steps_in_which_the_world_does(diagonals: list[bool]) -> None:
    side, horizon = 64, 40
    extra = np.array([0.0, 0.0, math.sqrt(2) - 1.0])
    fleet = PlannedFleet(
        np.zeros(1, np.int64), np.array([0, 1, side + 1]), np.arange(4)[None],
        np.zeros((3, 2), np.int64), extra[None], np.zeros((1, 3)), GridShape.square(side),
    )  # fmt: skip
    legs = np.array([side + 1 if diagonal else 1 for diagonal in diagonals])
    path = np.full((1, 1, horizon + 1), 5 * side + 5)
    path[..., 1 : len(legs) + 1] += np.cumsum(legs)
    [looks] = looks_of(fleet, path, np.array([[len(legs)]]))
    # A move ends when its time and those before it are over, see test_timed_actions.
    ends = np.cumsum([math.sqrt(2) if diagonal else 1.0 for diagonal in diagonals])
    assert [step for step, _ in looks] == (np.ceil(ends - 1e-6) - 1).astype(int).tolist()

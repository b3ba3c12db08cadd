# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the routes of a solver."""

from __future__ import annotations

import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.planners.registry import load_planner, planner_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.definition import SearchDefinition

ROOT = Path(__file__).resolve().parents[2]
PAPER: dict[str, Any] = {
    "grid_size": 8, "num_drones": 3, "sigma": 2, "vector": (0.1, 0.05), "timestep_limit": 25,
    "person_initial_position": (4, 5), "probability_of_detection": 0.0,
}  # fmt: skip


@pytest.mark.slow
def test_without_the_extra_one_line_says_what_to_install() -> None:
    code = (
        "import sys; sys.modules['ortools'] = None\n"
        "from dsse_ros.planners.registry import load_planner\n"
        "try:\n    load_planner('route')\n"
        "except ValueError as error:\n    print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120
    )
    (line,) = done.stdout.splitlines()
    assert re.search(r"pip install '/.*\[routes\]'", line)


def test_the_routes_keep_to_the_time_and_have_each_node_once() -> None:
    solve = pytest.importorskip("dsse_ros.planners.solved_routes", exc_type=ImportError).solve
    cells = [(0, 0), (7, 7), (1, 0), (2, 0), (7, 6), (7, 5), (0, 7)]
    ways = [[abs(a - c) + abs(b - d) for c, d in cells] for a, b in cells]
    routes = solve([ways] * 2, [0.2, 0.2, 0.2, 0.2, 0.1], 4)
    assert routes == [[2, 3], [4, 5]]
    for drone, route in enumerate(routes):
        steps = sum(ways[a][b] + 1 for a, b in pairwise([drone, *route]))
        assert steps <= 4
    (first, second) = solve([ways] * 2, [0.2, 0.2, 0.2, 0.2, 0.1], 20)
    assert sorted(first + second) == [2, 3, 4, 5, 6]


def test_a_busy_machine_gets_the_routes_of_an_idle_one(monkeypatch: pytest.MonkeyPatch) -> None:
    route = pytest.importorskip("dsse_ros.planners.solved_routes", exc_type=ImportError)
    rng = np.random.default_rng(0)
    cells = rng.integers(0, 40, (52, 2))
    ways = np.abs(cells[:, None] - cells[None]).max(axis=-1).tolist()
    problem = ([ways] * 4, (0.02 * rng.random(48)).tolist(), 25)
    idle = route.solve(*problem)
    parameters = route.pywrapcp.DefaultRoutingSearchParameters()
    # A part of the search then exceeds the time that the solver gives it by default.
    parameters.lns_time_limit.nanos = 1
    monkeypatch.setattr(route.pywrapcp, "DefaultRoutingSearchParameters", lambda: parameters)
    assert route.solve(*problem) == idle


def test_no_drone_collides_and_the_same_seed_gives_the_same_mission() -> None:
    pytest.importorskip("ortools")
    played = []
    for _ in range(2):
        env = parallel_env(**PAPER)
        planner = planner_for(env, "route", seed=1)
        observations, infos = env.reset(seed=2)
        actions = []
        while env.agents:
            assert len(env.agents) == 3
            actions.append(planner(observations, infos))
            observations, _, _, _, infos = env.step(actions[-1])
            observations = {agent: observations[agent] for agent in env.agents}
        played.append(actions)
    assert played[0] == played[1]
    assert len(played[0]) >= 25


def test_drones_that_look_in_passing_do_not_stop_where_a_look_is_sure() -> None:
    env = parallel_env(
        rules="v2", sensor="flown_over", grid_size=15, person_initial_position=(7, 7),
        dispersion_inc=0.1, vector=(0.0, 0.0), drones_positions=[(0, 7)], timestep_limit=60,
    )  # fmt: skip
    pytest.importorskip("ortools")
    planner = load_planner("route")(SearchDefinition(env.rules, env.scenario), seed=0)
    # Nobody is found.
    blind = parallel_env(env.scenario.override(probability_of_detection=0.0), rules=env.rules)
    observations, infos = blind.reset(seed=1)
    done = []
    while blind.agents:
        actions = planner(observations, infos)
        done.append(actions["drone0"])
        observations, _, _, _, infos = blind.step(actions)
    assert done.count(env.rules.action_set.search) <= 2

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Known values of search problems are reached, and the world plays what the planner states."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence

import numpy as np
import pytest
from chains import chain_of_walk, matrix_of
from numpy.typing import NDArray

from benchmarks.bench import RESULTS
from benchmarks.compare import RESULTS_PAGE
from benchmarks.pages import with_table
from benchmarks.paths.forward_backward import ForwardBackwardOptions
from benchmarks.search_problems import (
    WORLDS,
    Problem,
    eagle,
    phung_ha,
    row,
    royset_sato,
    solve,
    table,
)

EAGLE, (SMALLEST, *_), (DRIFTING,) = list(eagle()), royset_sato(), phung_ha()
SOME = [
    EAGLE[0],
    dataclasses.replace(SMALLEST, options=ForwardBackwardOptions(iterations=80)),
    dataclasses.replace(
        DRIFTING,
        best_known=0.18,
        options=ForwardBackwardOptions(iterations=0, revisits=False),
    ),
]

Path = Sequence[tuple[int, int]]


def walk(grid_size: int, stay: float) -> NDArray[np.float64]:
    """Return the transition matrix (C, C) of a walk that stays or enters one of its neighbours."""
    rows, cols = np.divmod(np.arange(grid_size**2), grid_size)
    distance = abs(rows[:, None] - rows) + abs(cols[:, None] - cols)
    leave = (1.0 - stay) * (distance == 1) / (distance == 1).sum(axis=1, keepdims=True)
    return leave + stay * np.eye(grid_size**2)


def missed_walking(
    paths: Sequence[Path], grid_size: int, stay: float, start: int, miss: float
) -> float:
    """Return the probability that all looks of J searchers at a walk miss."""
    undetected = np.eye(grid_size**2)[start]
    for cells in zip(*paths, strict=True):
        for x, y in cells:
            undetected[y * grid_size + x] *= miss
        undetected = undetected @ walk(grid_size, stay)
    return float(undetected.sum())


def missed_drifting(path: Path) -> float:
    """Return the probability that all looks at the map of Phung and Ha miss."""
    line = np.arange(1, 41)
    near = [np.exp(-((line - mean) ** 2) / 8.0) for mean in (5, 10)]
    map_now = sum(0.5 * np.outer(spread, spread) / spread.sum() ** 2 for spread in near)
    missed = 1.0
    for look, (x, y) in enumerate(path, 1):
        if look % 2 == 0:
            map_now = np.pad(map_now, ((0, 0), (1, 0)))[:, :-1]
            map_now /= map_now.sum()
        missed *= 1.0 - map_now[y, x]
        map_now[y, x] = 0.0
        map_now /= map_now.sum()
    return missed


def test_plans_have_their_values_by_the_published_definitions() -> None:
    eagle_1, royset_sato_8, drifting = (solve(problem) for problem in SOME)
    assert 1.0 - missed_walking(eagle_1.paths, 3, 0.4, 8, 0.0) == pytest.approx(eagle_1.played)
    missed = missed_walking(royset_sato_8.paths, 9, 0.6, 40, 0.4)
    assert 1.0 - missed == pytest.approx(royset_sato_8.played)
    assert 1.0 - missed_drifting(drifting.paths[0]) == pytest.approx(drifting.played)


@pytest.mark.parametrize("problem", SOME, ids=lambda problem: problem.title)
def test_the_world_plays_what_the_planner_states(problem: Problem) -> None:
    solution = solve(problem)
    assert solution.played == pytest.approx(solution.stated, abs=1e-9)
    # Four standard errors.
    error = (solution.played * (1.0 - solution.played) / WORLDS) ** 0.5
    assert solution.found == pytest.approx(solution.played, abs=4 * error)
    assert row(problem, solution)["reached"]


@pytest.mark.parametrize("problem", EAGLE, ids=lambda problem: problem.title)
def test_the_optimum_of_eagle_is_proven(problem: Problem) -> None:
    solution = solve(problem)
    assert solution.stated == pytest.approx(problem.published, abs=5e-5)
    assert solution.bound <= solution.stated + 1e-8


@pytest.mark.parametrize("problem", [EAGLE[0], EAGLE[4]], ids=lambda problem: problem.title)
@pytest.mark.parametrize("form", ["steps", "matrix"])
def test_eagle_s_problem_as_a_chain_has_the_same_plan_and_finds(
    problem: Problem, form: str
) -> None:
    chain = chain_of_walk(3, problem.rules.person_steps)
    chances = chain if form == "steps" else matrix_of(chain)
    walk, as_chain = (
        solve(problem),
        solve(
            dataclasses.replace(
                problem,
                scenario=problem.scenario.override(transition_probabilities=chances),
                rules=problem.rules.override(person_motion="markov_chain"),
            )
        ),
    )
    assert (as_chain.paths, as_chain.found) == (walk.paths, walk.found)
    assert as_chain.played == pytest.approx(walk.played, abs=1e-12)
    assert as_chain.stated == pytest.approx(walk.stated, abs=1e-12)


def test_a_drone_of_phung_and_ha_is_in_no_cell_twice() -> None:
    (path,) = solve(SOME[2]).paths
    assert path[0] == (20, 20) and len(set(path)) == 20


def test_the_page_has_the_last_results() -> None:
    rows = json.loads((RESULTS / "reproduce.json").read_text(encoding="utf-8"))["problems"]
    page = RESULTS_PAGE.read_text(encoding="utf-8")
    assert table(rows) in with_table(page, "problems", table(rows)) == page

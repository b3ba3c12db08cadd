# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Known values of search problems are reached, and the world plays what the planner states."""

from __future__ import annotations

import dataclasses

import pytest
from chains import chain_of_walk, matrix_of

from benchmarks.search_problems import WORLDS, Problem, eagle, phung_ha, row, royset_sato, solve
from dsse_ros.planners.forward_backward import ImproveOptions

EAGLE, (SMALLEST, *_), (DRIFTING,) = list(eagle()), royset_sato(), phung_ha()
SOME = [
    EAGLE[0],
    dataclasses.replace(SMALLEST, improvement=ImproveOptions(iterations=80)),
    dataclasses.replace(
        DRIFTING, best_known=0.18, improvement=ImproveOptions(iterations=0, revisits=False)
    ),
]


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
    given = chain if form == "steps" else matrix_of(chain)
    walk, as_chain = (
        solve(problem),
        solve(
            dataclasses.replace(
                problem,
                scenario=problem.scenario.override(transition_probabilities=given),
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

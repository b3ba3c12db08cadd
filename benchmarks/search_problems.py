# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Search problems with known values, planned by `ForwardBackward` and played in the world.

The value of a problem is the probability of success of all looks.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import mpso
from benchmarks.paths.bound import upper_bound
from benchmarks.paths.forward_backward import ForwardBackward, ForwardBackwardOptions
from dsse_ros.planners.planner import DecisionPoint
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.environments.world import World
from dsse_ros.search.step.looks import looks_of
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import Scenario, scenario_and_rules

SEED = 1
WORLDS = 20_000
CUTS = 300
"""Linear functions for the bound of several searchers."""
_OPTIMAL = "0, optimal"


@dataclass(frozen=True)
class Problem:
    """A search problem.

    Attributes:
        title: Source and instance.
        scenario: The scenario; `timestep_limit` is the number of looks.
        rules: The rules of the search.
        published: Published value; None if there is none.
        best_known: Value of the best known plan before ours, computed from the plan.
        tolerance: Relative difference from `best_known` that is allowed.
        seconds: CPU time that is allowed.
        options: Options of the planner, without those that follow from the problem.
        lead: Looks in the start cells before the first move.
    """

    title: str
    scenario: Scenario
    rules: Rules
    published: float | None
    best_known: float | None
    tolerance: float
    seconds: float
    options: ForwardBackwardOptions
    lead: int = 0


@dataclass(frozen=True)
class Solution:
    """The plan for a problem.

    Attributes:
        stated: Value by the planner.
        played: Value by the exact belief after all looks.
        found: Share of `WORLDS` worlds in which the looks find the person.
        bound: Bound on the value of all plans.
        seconds: CPU time of the planner.
        paths: Cells after each step, by drone.
    """

    stated: float
    played: float
    found: float
    bound: float
    seconds: float
    paths: list[list[tuple[int, int]]] = field(repr=False)


def eagle() -> Iterator[Problem]:
    """Yield the problems of Eagle, Operations Research 32 (1984), table I: nine starts."""
    optimum = dict.fromkeys((2, 3, 4, 5, 7), 0.8631) | dict.fromkeys((6, 8, 9), 1.0) | {1: 0.7786}
    for start in range(1, 10):
        scenario, rules = scenario_and_rules(
            rules="paper", person_motion="random_walk", person_steps=_plus(0.4), collisions=False,
            sensor="flown_over", grid_size=3, timestep_limit=10, person_initial_position=(2, 2),
            drones_positions=[((start - 1) % 3, (start - 1) // 3)],
        )  # fmt: skip
        yield Problem(
            f"Eagle, start {start}", scenario, rules, optimum[start], optimum[start], 5e-5, 1.0,
            ForwardBackwardOptions(iterations=0, proof_width=4096),
        )  # fmt: skip


def royset_sato() -> Iterator[Problem]:
    """Yield the problems of Royset and Sato, Naval Research Logistics 57 (2010).

    The published values are logged by a solver that minimises the probability of no detection by
    cutting planes, up to 1e-4 below the value of its plan. Those of 8 to 11 looks are optimal.
    """
    logged = (
        0.6873690883, 0.5805588675, 0.5154632988, 0.4712110556, 0.4379770265, 0.4127679399, None,
    )  # fmt: skip
    best = (
        0.6873697326, 0.5805670709, 0.5154735461, 0.4712220923, 0.4379911016, 0.4115459897,
        0.3840290312,
    )  # fmt: skip
    for looks, value, least in zip(range(8, 15), logged, best, strict=True):
        few = looks <= 11
        published = None if value is None else 1.0 - value
        yield _royset_sato(
            3, looks, published, 1.0 - least, 1e-4 if few else 1e-9, 1.0 if few else 10.0,
            200 if few else 1000,
        )  # fmt: skip
    for looks in (8, 10, 12, 14):
        yield _royset_sato(15, looks, None, None, 0.0, 10.0, 40)


def _royset_sato(
    drones: int,
    looks: int,
    published: float | None,
    best_known: float | None,
    tolerance: float,
    seconds: float,
    iterations: int,
) -> Problem:
    scenario, rules = scenario_and_rules(
        rules="paper", person_motion="random_walk", person_steps=_plus(0.6), collisions=False,
        sensor="flown_over", grid_size=9, timestep_limit=looks, person_initial_position=(4, 4),
        drones_positions=[(0, 0)] * drones, probability_of_detection=1.0 - 0.4 ** (3 / drones),
    )  # fmt: skip
    return Problem(
        f"Royset and Sato, {drones} searchers, {looks} looks", scenario, rules, published,
        best_known, tolerance, seconds, ForwardBackwardOptions(iterations=iterations),
    )  # fmt: skip


def phung_ha() -> Iterator[Problem]:
    """Yield the problem of Phung and Ha, arXiv 2010.02039: a map that drifts, no cell twice."""
    line = np.arange(1, 41)

    def normal(mean: int) -> NDArray[np.float64]:
        along = np.exp(-((line - mean) ** 2) / 8.0)
        matrix = np.outer(along, along)
        normed: NDArray[np.float64] = matrix / matrix.sum()
        return normed

    scenario, rules = scenario_and_rules(
        rules="paper", person_motion="drifting_map", collisions=False, sensor="flown_over",
        actions=["left", "right", "up", "down", "up_left", "up_right", "down_left", "down_right",
                 "search"],
        grid_size=40, timestep_limit=20, vector=(0.5, 0.0), drones_positions=[(20, 20)],
        probability_matrix=0.5 * normal(10) + 0.5 * normal(5),
    )  # fmt: skip
    yield Problem(
        "Phung and Ha", scenario, rules, None, 0.18858, 0.0, 5.0,
        ForwardBackwardOptions(iterations=100, proof_width=64, revisits=False), lead=1,
    )  # fmt: skip


def _plus(stay: float) -> tuple[float, ...]:
    """Return the steps of a walk that stays or takes one of the four straight steps."""
    side = (1.0 - stay) / 4.0
    return (0.0, side, 0.0, side, stay, side, 0.0, side, 0.0)


def problems() -> list[Problem]:
    """Return all problems."""
    return [*eagle(), *royset_sato(), *phung_ha()]


def solve(problem: Problem) -> Solution:
    """Plan, play the plan with the exact belief, and play it in many worlds."""
    scenario, rules = problem.scenario.resolve(problem.rules), problem.rules
    steps = scenario.timestep_limit
    options = replace(problem.options, horizon=steps - problem.lead, gamma=1.0, kappa=0.0)
    forecast = forecast_for(scenario, rules, horizon=steps - problem.lead)
    belief, present = forecast.belief(), list(scenario.drones_positions)
    looks, actions = looks_of(scenario, rules), rules.action_set
    agents = list(range(len(present)))
    for _ in range(problem.lead):
        belief.update([look for n in agents for look in looks.done(n, actions.search, present[n])])
        belief.advance()
    before = belief.pos
    tactic = ForwardBackward(forecast, options, seed=SEED)
    began = time.process_time()
    tactic(DecisionPoint(belief, agents, present))
    seconds = time.process_time() - began
    assert tactic.problem is not None
    bound = tactic.bound
    if len(agents) > 1:
        bound = upper_bound(tactic.problem, CUTS, np.random.default_rng(SEED))
    stated, bound = (before + (1.0 - before) * value for value in (tactic.value, bound))

    planned = tactic.paths()
    paths = [[present[n]] * problem.lead + planned[n] for n in agents]
    world = World(scenario, rules, WORLDS, write_maps=False)
    world.seed(SEED)
    world.reset()
    found, belief = np.zeros(WORLDS, bool), forecast.belief()
    for step in range(steps):
        cells = [path[step] for path in paths]
        joint = [actions.action(a, b) for a, b in zip(present, cells, strict=True)]
        belief.update([look for n in agents for look in looks.done(n, joint[n], cells[n])])
        belief.advance()
        world.step(np.tile(np.array(joint, np.int8), (WORLDS, 1)))
        found |= world.worlds["num_missing"] == 0
        present = cells
    world.close()
    return Solution(stated, belief.pos, float(found.mean()), bound, seconds, paths)


def row(problem: Problem, solution: Solution) -> dict[str, Any]:
    """Return the figures of a problem, and whether the plan is as good and as fast as required."""
    known, value = problem.best_known, solution.played
    return {
        "title": problem.title,
        "published": problem.published,
        "best_known": known,
        "value": value,
        "stated": solution.stated,
        "found": solution.found,
        "bound": min(solution.bound, 1.0),
        "seconds": solution.seconds,
        "reached": known is None or value >= known * (1.0 - problem.tolerance),
        "in_time": solution.seconds <= problem.seconds,
    }


def row_of_mpso(flown: mpso.Flown, ours: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of MPSO beside our own for the same problem; they are not judged."""
    judged = {"stated": None, "found": None, "reached": True, "in_time": True}
    of_mpso = {"title": f"{ours['title']}, by MPSO", "value": flown.value, "seconds": flown.seconds}
    return {**ours, **judged, **of_mpso}


def _line(problem: dict[str, Any]) -> str:
    """Return what problems in one line of the table have in common."""
    title: str = problem["title"]
    return title.partition(",")[0] if _gap(problem) == _OPTIMAL else title


def _gap(problem: dict[str, Any]) -> str:
    """Return by how much the bound exceeds the value."""
    gap = max(problem["bound"] / problem["value"] - 1.0, 0.0)
    return _OPTIMAL if gap < 1e-8 else f"{gap:.1%}" if np.isfinite(gap) else "-"


def _shown(values: list[float]) -> str:
    """Return a value, or the least and the greatest of several."""
    low, high = (f"{end(values):.6f}" for end in (min, max))
    return low if low == high else f"{low} to {high}"


def table(rows: list[dict[str, Any]]) -> str:
    """Return the figures as a table in Markdown, of problems that others have solved.

    Proven optima of one source are in one line.
    """
    lines = [
        "| Problem | Published, else best known | Value | Gap to the bound |",
        "| --- | --- | --- | --- |",
    ]
    known = [row for row in rows if row["published"] or row["best_known"]]
    for _, group in itertools.groupby(known, _line):
        same = list(group)
        first = same[0]["title"]
        title = first if len(same) == 1 else f"{first.partition(',')[0]}, {len(same)} problems"
        published = _shown([row["published"] or row["best_known"] for row in same])
        value = _shown([row["value"] for row in same])
        lines.append(f"| {title} | {published} | {value} | {_gap(same[0])} |")
    return "\n".join(lines)


def run(of_mpso: mpso.Flown | None = None) -> list[dict[str, Any]]:
    """Solve all problems, after one of each kind has compiled the planner.

    Args:
        of_mpso: The result of MPSO for the last problem; None to leave it out.
    """
    chosen = problems()
    for problem in (chosen[0], chosen[9], chosen[-1]):
        solve(problem)
    rows = [row(problem, solve(problem)) for problem in chosen]
    if of_mpso is not None:
        rows.append(row_of_mpso(of_mpso, rows[-1]))
    return rows


if __name__ == "__main__":
    print(table(run()))

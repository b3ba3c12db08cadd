# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planner `forward_backward`: improves the joint plan of `belief` with the exact filter.

See `path_search` for the method.
"""

from __future__ import annotations

import math
import time
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsse_ros.belief.protocol import TargetForecast
from dsse_ros.planners.beam import column_at, move_between
from dsse_ros.planners.beam_search import BeamOptions, BeamSearch, PlannedPath
from dsse_ros.planners.belief import BeamOnBelief, BeliefPlanner
from dsse_ros.planners.path_problem import PathProblem, Plan, SearchGraph, search_graph
from dsse_ros.planners.path_search import improve
from dsse_ros.planners.planner import DecisionPoint, Search, number_of
from dsse_ros.scenario.actions import Cell

UNLIMITED = 10**9


@dataclass(frozen=True, kw_only=True)
class ImproveOptions:
    """Options of the improvement.

    Attributes:
        iterations: How often one or two drones get other paths, see `path_search.improve`.
        budget_ms: Wall time of a decision, in place of `iterations`. The plans then depend on the
            machine: the same seed need not give the same mission.
        width: Paths that branch and bound keeps, see `path_search.improve`.
        revisits: Whether a drone may be in a cell twice.
    """

    iterations: int = 2
    budget_ms: float | None = None
    width: int = 1
    revisits: bool = True


class ForwardBackward(BeamSearch):
    """Plans for the drones of one mission: those of `BeamSearch`, improved.

    Args:
        forecast: See `BeamSearch`.
        options: See `BeamSearch`.
        improvement: Options of the improvement.
        seed: Seed of all draws.

    Attributes:
        value: Expected value of the last plan from its step on: the discounted probability of
            detection, and the worth of the persons left, see `BeamOptions`.
        bound: A bound on it, see `path_search.Improved`.
        problem: The last search that was solved; None before the first step.
    """

    def __init__(
        self,
        forecast: TargetForecast,
        options: BeamOptions,
        improvement: ImproveOptions,
        *,
        seed: int = 0,
    ) -> None:
        super().__init__(forecast, options, seed=seed)
        self._improvement = improvement
        self._graphs = [self._graph(kind) for kind in range(len(self._looks.first))]
        self.value, self.bound = 0.0, math.inf
        self.problem: PathProblem | None = None

    def _graph(self, kind: int) -> SearchGraph:
        """Return the moves and looks of a kind of drone on the columns of the belief."""
        side, cells = self._forecast.side, self._forecast.side**2
        on_grid = np.array([column_at(side, i, 0, 0) >= 0 for i in range(cells)])
        ahead = np.arange(cells) + self._moves[:, None]
        valid = (ahead >= 0) & (ahead < cells)
        to = ahead % cells
        # A drone outside the area may pass over cells outside on its way into it.
        leaves = self._masked[to] & ~self._masked
        ahead[~valid | ~on_grid[to] | leaves] = -1
        looks = self._looks.of_kind(kind)
        there = np.array(
            [[column_at(side, i, dx, dy) for i in range(cells)] for dx, dy in looks.offsets],
            np.int64,
        ).reshape(-1, cells)
        return search_graph(ahead, looks.first, there, looks.pods)

    def __call__(self, at: DecisionPoint) -> list[Cell]:
        """Return the next cell of each drone; see `BeamSearch`."""
        belief, agents, present, deadline_s, batteries = at
        options, improvement, iterations = self._options, self._improvement, UNLIMITED
        if improvement.budget_ms is None:
            iterations = improvement.iterations
        else:
            deadline_s = min(deadline_s, time.monotonic() + improvement.budget_ms / 1000)
        left = self._forecast.scenario.timestep_limit - belief.step
        horizon = max(1, min(self._forecast.horizon, left))
        last = self._last_plans(agents, present, horizon)
        cells = super().__call__(at._replace(deadline_s=deadline_s))
        kinds = self._kinds.kind[[number_of(agent) for agent in agents]]
        beyond = self._beyond(agents, batteries, horizon)
        self.problem = problem = PathProblem(
            belief.chain(horizon),
            [self._graphs[kind] for kind in kinds],
            [self._forecast.column(cell) for cell in present],
            np.power(options.gamma, np.arange(horizon)),
            blocked=np.stack(beyond) if beyond else None,
            apart=self._forecast.rules.collisions,
            revisits=improvement.revisits,
            nearness=options.kappa * self._nearness if options.kappa > 0.0 else None,
        )
        plans = self._moves_of([self._plans[agent] for agent in agents], horizon)
        if all(plan.length >= horizon - 1 for plan in last):
            before = self._moves_of(last, horizon)
            if problem.value(before) > problem.value(plans):
                plans = before
        improved = improve(
            problem, plans, self._rng, iterations=iterations, deadline_s=deadline_s,
            width=improvement.width,
        )  # fmt: skip
        self.value, self.bound = improved.value, improved.bound
        for n, (agent, plan) in enumerate(zip(agents, improved.plans, strict=True)):
            path = np.array([problem.starts[n], *problem.cells(n, plan)])
            self._plans[agent] = PlannedPath(path, horizon)
            cells[n] = self._forecast.cell(int(path[1]))
        return cells

    def paths(self) -> dict[Hashable, list[Cell]]:
        """Return the planned cells of each drone, from its next one on."""
        return {
            agent: [self._forecast.cell(int(column)) for column in plan.path[1:]]
            for agent, plan in self._plans.items()
        }

    def _moves_of(self, plans: Sequence[PlannedPath], horizon: int) -> list[Plan | None]:
        """Return the moves of plans; a drone stays at the end of a shorter plan."""
        moves: list[Plan | None] = []
        for plan in plans:
            steps = zip(plan.path[:horizon], plan.path[1:], strict=True)
            moves.append(np.array([move_between(self._moves, a, b) for a, b in steps]))
        return moves


class ForwardBackwardOnBelief(BeamOnBelief):
    """Makes `ForwardBackward` for each mission.

    Args:
        options: Options of the beam search.
        improvement: Options of the improvement.
    """

    def __init__(self, options: BeamOptions, improvement: ImproveOptions) -> None:
        super().__init__(options)
        self._improvement = improvement

    def start(self, forecast: TargetForecast, seed: int) -> ForwardBackward:
        """Return the tactic for a mission."""
        return ForwardBackward(forecast, self._options, self._improvement, seed=seed)


def make_forward_backward(
    search: Search,
    *,
    seed: int = 0,
    learn_drift: bool = True,
    iterations: int = 2,
    budget_ms: float | None = None,
    proof_width: int = 1,
    revisits: bool = True,
    **options: Any,
) -> BeliefPlanner:
    """Return the planner `forward_backward`: the plans of `belief`, improved.

    Args:
        search: The rules and the scenario.
        seed: Seed of all draws.
        learn_drift: See `BeliefPlanner`.
        iterations: See `ImproveOptions`.
        budget_ms: See `ImproveOptions`.
        proof_width: `ImproveOptions.width`.
        revisits: See `ImproveOptions`.
        options: Other fields of `BeamOptions`.
    """
    improvement = ImproveOptions(
        iterations=iterations, budget_ms=budget_ms, width=proof_width, revisits=revisits
    )
    tactic = ForwardBackwardOnBelief(BeamOptions(**options), improvement)
    return BeliefPlanner(search, tactic, seed=seed, learn_drift=learn_drift)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tactic `ForwardBackward`: improves the joint plan of `belief` with the exact filter."""

from __future__ import annotations

import math
import time
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.paths.chain import chain_of
from benchmarks.paths.problem import PathProblem, Plan, SearchGraph, search_graph
from benchmarks.paths.search import improve
from dsse_ros.base.fields import field
from dsse_ros.planners.beam_search import BeamSearch, PlannedPath
from dsse_ros.planners.options import BeamOptions
from dsse_ros.planners.plan_kernels import Moves, column_at, move_between
from dsse_ros.planners.planner import DecisionPoint
from dsse_ros.search.belief.protocol import TargetForecast
from dsse_ros.world.scenario.actions import Cell

UNLIMITED = 10**9


@dataclass(frozen=True, kw_only=True)
class ForwardBackwardOptions(BeamOptions):
    """Options of the improvement of plans, see `search.improve`."""

    iterations: int = field(
        "int", "How often one or two drones get other paths.", 2, low=0, high=10**9
    )
    budget_ms: float | None = field(
        "float", "Wall time of a decision, in place of iterations. The same seed then need not "
        "give the same mission.", None, low=0, high=1e9, unit="ms",
    )  # fmt: skip
    proof_width: int = field(
        "int", "Paths that branch and bound keeps to prove the plan of a single drone optimal, if "
        "kappa is 0; 1: no proof.", 1, low=1, high=10**4,
    )  # fmt: skip
    revisits: bool = field("bool", "Whether a drone may be in a cell twice.", True)


class ForwardBackward(BeamSearch):
    """Plans for the drones of one mission: those of `BeamSearch`, improved.

    Args:
        forecast: See `BeamSearch`.
        options: Options of the search.
        seed: Seed of all draws.

    Attributes:
        value: Expected value of the last plan from its step on: the discounted probability of
            detection, and the worth of the persons left, see `BeamOptions`.
        bound: A bound on it, see `search.Improved`.
        problem: The last search that was solved; None before the first step.
    """

    _options: ForwardBackwardOptions

    def __init__(
        self, forecast: TargetForecast, options: ForwardBackwardOptions, *, seed: int = 0
    ) -> None:
        super().__init__(forecast, options, seed=seed)
        self._graphs = [self._graph(moves) for moves in self._kinds]
        self.value, self.bound = 0.0, math.inf
        self.problem: PathProblem | None = None

    def _graph(self, moves: Moves) -> SearchGraph:
        """Return the moves and looks of a kind of drone on the columns of the belief."""
        padded, cells = self._forecast.padded, self._forecast.padded.cells
        on_grid = np.array([column_at(padded, i, 0, 0) >= 0 for i in range(cells)])
        ahead = np.arange(cells) + moves.steps[:, None]
        valid = (ahead >= 0) & (ahead < cells)
        to = ahead % cells
        # A drone outside the area may pass over cells outside on its way into it.
        leaves = self._masked[to] & ~self._masked
        ahead[~valid | ~on_grid[to] | leaves | ~moves.able[:, None]] = -1
        there = np.array(
            [[column_at(padded, i, dx, dy) for i in range(cells)] for dx, dy in moves.offsets],
            np.int64,
        ).reshape(-1, cells)
        return search_graph(ahead, moves.starts, there, moves.pods)

    def __call__(self, at: DecisionPoint) -> list[Cell]:
        """Return the next cell of each drone; see `BeamSearch`."""
        belief, agents, present, deadline_s, batteries = at
        options, iterations = self._options, UNLIMITED
        if options.budget_ms is None:
            iterations = options.iterations
        else:
            deadline_s = min(deadline_s, time.monotonic() + options.budget_ms / 1000)
        left = self._forecast.scenario.timestep_limit - belief.step
        horizon = max(1, min(self._forecast.horizon, left))
        last = self._last_plans(agents, present, horizon)
        cells = super().__call__(at._replace(deadline_s=deadline_s))
        kinds = [self._swarm.kind_of(agent) for agent in agents]
        beyond = self._beyond(agents, batteries, horizon)
        self.problem = problem = PathProblem(
            chain_of(belief, horizon),
            [self._graphs[kind] for kind in kinds],
            [self._forecast.column(cell) for cell in present],
            np.power(options.gamma, np.arange(horizon)),
            blocked=np.stack(beyond) if beyond else None,
            apart=self._forecast.rules.collisions,
            revisits=options.revisits,
            nearness=options.kappa * self._kinds[0].nearness if options.kappa > 0.0 else None,
        )
        plans = self._moves_of([self._plans[agent] for agent in agents], horizon)
        if all(plan.length >= horizon - 1 for plan in last):
            before = self._moves_of(last, horizon)
            if problem.value(before) > problem.value(plans):
                plans = before
        improved = improve(
            problem, plans, self._rng, iterations=iterations, deadline_s=deadline_s,
            width=options.proof_width,
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
            moves.append(np.array([move_between(self._kinds[0].steps, a, b) for a, b in steps]))
        return moves

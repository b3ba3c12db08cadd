# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Optimal allocation of search effort over the cells, then routed.

Which cells to search how often, if flying between them took no time: Koopman, "The theory of
search III: the optimum distribution of searching effort" (1957), and Stone, "Theory of Optimal
Search" (1975), chapter 2. For the exponential detection function 1 - exp(-a z) the optimum levels
what is left of the probability: z = ln(p a / l) / a where p a > l, with a Lagrange multiplier l so
that the effort is spent. Searches are whole, so that k of them detect with 1 - (1 - POD)^k; this
is the exponential function with a = -ln(1 - POD) at whole numbers, and to take the search of the
greatest gain, one by one, is optimal.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.belief.beliefs import AnyBelief, AnyForecast
from dsse_ros.planners.belief import BeliefPlanner
from dsse_ros.planners.belief_routes import BeliefRoutePlan, RoutePlanning
from dsse_ros.planners.planner import Cell, Search
from dsse_ros.scenario.actions import ActionSet


def make_optimal_effort(
    search: Search, *, seed: int = 0, learn_drift: bool = True, period: int = 4
) -> BeliefPlanner:
    """Return a planner that allocates the effort of the next steps and routes it.

    The effort is what the drones could search if they did not have to move.

    Args:
        search: What it may know: rules and scenario.
        seed: For the choice of the cell to step aside to when a way is blocked.
        learn_drift: See `BeliefPlanner`.
        period: Steps between two plans.
    """

    def plan_for(forecast: AnyForecast) -> BeliefRoutePlan:
        area = forecast.scenario.area_mask
        actions = forecast.rules.action_set.within(area).with_moves()

        def plan(belief: AnyBelief, present: Sequence[Cell], steps: int) -> list[list[Cell]]:
            effort = steps * len(present)
            searches = allocate(belief.cells(), belief.mean_pod, effort)
            return nearest_routes(present, searches, actions)

        return plan

    tactic = RoutePlanning(plan_for, period)
    return BeliefPlanner(search, tactic, seed=seed, learn_drift=learn_drift)


def allocate(likely: NDArray[np.float64], pod: float, searches: int) -> dict[Cell, int]:
    """Return how often to search which cells (col, row) so that the POS is greatest.

    Args:
        likely: (G, G) probability of containment, [row, col].
        pod: Probability that a search detects the person who is in its cell.
        searches: How many there are to allocate; fewer are where nothing is left to gain.
    """
    size = likely.shape[1]
    count = min(searches, likely.size)
    best = np.argpartition(-likely, count - 1, axis=None)[:count]
    gains = [(-float(likely.flat[i]) * pod, int(i)) for i in best]
    heapq.heapify(gains)
    allocated: dict[Cell, int] = {}
    for _ in range(searches):
        gain, i = gains[0]
        if gain == 0.0:
            break
        cell = (i % size, i // size)
        allocated[cell] = allocated.get(cell, 0) + 1
        heapq.heapreplace(gains, (gain * (1.0 - pod), i))
    return allocated


def nearest_routes(
    present: Sequence[Cell], searches: dict[Cell, int], actions: ActionSet
) -> list[list[Cell]]:
    """Deal cells to drones: the one that is free first takes the cell nearest to it.

    Args:
        present: Cells of the drones.
        searches: How often to search which cells.
        actions: Measure the ways.

    Returns:
        The cells that each drone searches in their order, one that is searched twice two times; its
        own cell where nothing is left for it. Cells that no drone can get to are left out.
    """
    left = dict(searches)
    routes: list[list[Cell]] = [[] for _ in present]
    ends, busy = list(present), [0] * len(present)
    while left:
        ways = [
            (busy[n] + way, place, cell, n)
            for n, end in enumerate(ends)
            for place, cell in enumerate(left)
            if (way := actions.distance(end, cell)) >= 0
        ]
        if not ways:
            break
        steps, _, cell, n = min(ways)
        times = left.pop(cell)
        routes[n] += [cell] * times
        ends[n], busy[n] = cell, steps + times
    return [route or [cell] for route, cell in zip(routes, present, strict=True)]

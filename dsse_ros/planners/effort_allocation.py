# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Allocation of search effort over the cells, and routes to search them.

The routes are not optimal: the drones fly to the nearest cells first. The allocation is optimal if
flying between cells took no time. It gives how often to search each cell: Koopman,
"The theory of search III: the optimum distribution of searching effort" (1957), and Stone, "Theory
of Optimal Search" (1975), chapter 2. For the exponential detection function 1 - exp(-a z) the
optimum levels the remaining probability: z = ln(p a / l) / a where p a > l, with a Lagrange
multiplier l that spends exactly the effort. The number of searches is whole: k searches detect
with 1 - (1 - POD)^k. This is the exponential function with a = -ln(1 - POD) at whole numbers, and
it is optimal to choose the search with the greatest gain, one by one.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.belief import BeliefPlanner
from dsse_ros.planners.belief_routes import RoutesOnBelief
from dsse_ros.planners.options import BeliefOptions
from dsse_ros.planners.planner import Cell, Search
from dsse_ros.search.belief.protocol import TargetBelief
from dsse_ros.search.step.looks import searches_of
from dsse_ros.world.scenario.actions import ActionSet

LookAround = Sequence[tuple[int, int, float]]
"""Looks of a search, each dx, dy and POD: see `sensors.sensor.Look`."""

SURE_LOOK: LookAround = [(0, 0, 1.0)]
"""A look at the searched cell with a POD of 1."""


class EffortAllocation(RoutesOnBelief):
    """Allocates the effort of the next steps, and routes it.

    The effort is the number of searches that the drones could do if they did not have to move.
    """

    period = 4

    def plan(
        self, belief: TargetBelief, present: Sequence[Cell], steps: int, able: Sequence[ActionSet]
    ) -> list[list[Cell]]:
        """See `RoutesOnBelief.plan`."""
        reach = reach_of(able, present)
        searches = allocate(belief.poc(), looks_of_search(belief), steps * len(present), reach)
        return nearest_routes(present, searches, able, in_passing=self._in_passing)


def make_effort_allocation(search: Search, options: BeliefOptions, *, seed: int) -> BeliefPlanner:
    """Return the planner `effort_allocation`; see `RoutesOnBelief` for the seed."""
    return BeliefPlanner(search, EffortAllocation, seed=seed, learn_drift=options.learn_drift)


def looks_of_search(belief: TargetBelief) -> LookAround:
    """Return the looks of a search by the first drone, with the mean POD of missing persons."""
    forecast = belief.forecast
    looks = searches_of(forecast.scenario, forecast.rules, [(0, 0)])
    return [(*cell, belief.mean_pod(pods)) for cell, pods in looks]


def expected_finds(likely: NDArray[np.float64], looks: LookAround) -> NDArray[np.float64]:
    """Return the expected finds of a search in each cell, (R, C) [row, col].

    Args:
        likely: (R, C) probability of containment, [row, col].
        looks: Looks of a search.
    """
    return np.sum([_seen(likely, look) for look in looks], axis=0) if looks else 0.0 * likely


def _seen(likely: NDArray[np.float64], look: tuple[int, int, float]) -> NDArray[np.float64]:
    """Return the expected finds of a look, by the cell of the drone, (R, C)."""
    dx, dy, pod = look
    rows, cols = likely.shape
    around = np.pad(likely, ((abs(dy), abs(dy)), (abs(dx), abs(dx))))
    return around[abs(dy) + dy :, abs(dx) + dx :][:rows, :cols] * pod


def reach_of(actions: Sequence[ActionSet], present: Sequence[Cell]) -> NDArray[np.bool_] | None:
    """Return the cells to which moves of any drone lead, (R, C) bool [row, col]; None for all.

    Args:
        actions: Actions of each drone.
        present: Cells of the drones.
    """
    reach: NDArray[np.bool_] | None = None
    for able, cell in zip(actions, present, strict=True):
        of_drone = able.reachable(cell)
        if of_drone is None:
            return None
        reach = of_drone if reach is None else reach | of_drone
    return reach


def allocate(
    likely: NDArray[np.float64],
    looks: LookAround,
    searches: int,
    reach: NDArray[np.bool_] | None = None,
) -> dict[Cell, int]:
    """Return how often to search each cell (col, row) for the greatest POS.

    Args:
        likely: (R, C) probability of containment, [row, col].
        looks: Looks of a search.
        searches: Searches to allocate; the function allocates fewer if nothing is left to gain.
        reach: (R, C) bool [row, col], the cells in which to search; None for all.
    """
    if not looks:
        return {}
    rows, cols = likely.shape
    parts = [_seen(likely, look) for look in looks]
    if reach is not None:
        parts = [np.where(reach, part, 0.0) for part in parts]
    # Searches can overlap and take gain from each other, so consider more cells than searches.
    count = min(searches * len(looks) ** 2, likely.size)
    best = np.argpartition(-np.sum(parts, axis=0), count - 1, axis=None)
    gains = [(-float(sum(part.flat[i] for part in parts)), int(i)) for i in best[:count]]
    heapq.heapify(gains)
    allocated: dict[Cell, int] = {}
    left = searches
    while left:
        _, i = gains[0]
        gain = -float(sum(part.flat[i] for part in parts))
        if gain > gains[0][0]:
            # Another search has taken some of the gain.
            heapq.heapreplace(gains, (gain, i))
            continue
        if gain == 0.0:
            break
        col, row = i % cols, i // cols
        allocated[col, row] = allocated.get((col, row), 0) + 1
        left -= 1
        for dx, dy, pod in looks:
            for part, (other_dx, other_dy, _) in zip(parts, looks, strict=True):
                x, y = col + dx - other_dx, row + dy - other_dy
                if 0 <= x < cols and 0 <= y < rows:
                    part[y, x] *= 1.0 - pod
        heapq.heapreplace(gains, (-float(sum(part.flat[i] for part in parts)), i))
    return allocated


def nearest_routes(
    present: Sequence[Cell],
    searches: dict[Cell, int],
    actions: Sequence[ActionSet],
    *,
    in_passing: bool = False,
) -> list[list[Cell]]:
    """Assign cells to drones: always the cell and drone where the drone arrives first.

    Args:
        present: Cells of the drones.
        searches: How often to search each cell.
        actions: Actions of each drone; they measure the distances.
        in_passing: Whether drones look at the cells that they enter.

    Returns:
        The cells that each drone searches, in order, with a cell to search twice listed twice. A
        drone without any gets its own cell. Cells that no drone can reach are left out.
    """
    left = dict(searches)
    routes: list[list[Cell]] = [[] for _ in present]
    ends, busy = list(present), [0] * len(present)
    while left:
        ways = [
            (busy[n] + way, place, cell, n)
            for n, end in enumerate(ends)
            for place, cell in enumerate(left)
            if (way := actions[n].distance(end, cell)) >= 0
        ]
        if not ways:
            break
        steps, _, cell, n = min(ways)
        times = left.pop(cell)
        routes[n] += [cell] * times
        ends[n], busy[n] = cell, steps + times - in_passing
    return [route or [cell] for route, cell in zip(routes, present, strict=True)]

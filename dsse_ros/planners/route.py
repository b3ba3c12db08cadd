# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Routes from OR-Tools, a solver of vehicle routing problems, which the extra `routes` installs.

This is a team orienteering problem (Chao, Golden, Wasil, "The team orienteering problem", 1996):
the drones collect as much of the probability in the likely cells as they can in the given time.
Cells that they leave out cost a penalty.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dsse_ros.belief.protocol import TargetBelief
from dsse_ros.extras import pip_install
from dsse_ros.planners.belief import BeliefPlanner
from dsse_ros.planners.belief_routes import RoutePlanning
from dsse_ros.planners.optimal_effort import (
    SURE_LOOK,
    allocate,
    expected_finds,
    looks_of_search,
)
from dsse_ros.planners.planner import Cell, Search
from dsse_ros.scenario.actions import ActionSet

try:
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2
except ImportError as error:
    raise ImportError(f"{error}; {pip_install('routes')}") from error

MICRO = 1_000_000
"""Scale of the gains: the solver takes whole numbers only."""
NEVER = 1_000_000
"""Steps to a cell that cannot be reached."""
_UNLIMITED_S = 86_400
"""Wall time for each part of the local search, which takes microseconds."""


def make_route(
    search: Search,
    *,
    seed: int = 0,
    learn_drift: bool = True,
    period: int = 3,
    reach: int = 15,
    cells_per_drone: int = 12,
) -> BeliefPlanner:
    """Return a planner that flies the routes of a solver.

    Args:
        search: The rules and the scenario.
        seed: Seed for the choice of the cell to step aside to when a route is blocked.
        learn_drift: See `BeliefPlanner`.
        period: Steps between two plans.
        reach: Steps that a route may take after the drones have arrived, unless the mission ends
            sooner.
        cells_per_drone: Number of the most likely cells per drone to choose the routes from.
    """

    def plan(
        belief: TargetBelief, present: Sequence[Cell], steps: int, actions: ActionSet
    ) -> list[list[Cell]]:
        likely = belief.poc()
        chosen = list(allocate(likely, SURE_LOOK, cells_per_drone * len(present)))
        chosen = chosen or [present[0]]
        found = expected_finds(likely, looks_of_search(belief))
        gains = [float(found[row, col]) for col, row in chosen]
        nodes = [*present, *chosen]
        ways = [[_steps(actions.distance(a, b)) for b in nodes] for a in nodes]
        nearest = [min(row[len(present) :]) for row in ways[: len(present)]]
        there = max((steps for steps in nearest if steps < NEVER), default=0)
        limit = belief.forecast.scenario.timestep_limit
        time = max(1, min(there + reach, limit - belief.step))
        return [
            [nodes[i] for i in route] or [cell]
            for route, cell in zip(solve(ways, gains, len(present), time), present, strict=True)
        ]

    tactic = RoutePlanning(plan, period)
    return BeliefPlanner(search, tactic, seed=seed, learn_drift=learn_drift)


def _steps(distance: int) -> int:
    return distance if distance >= 0 else NEVER


def solve(
    ways: Sequence[Sequence[int]], gains: Sequence[float], drones: int, time: int
) -> list[list[int]]:
    """Return the nodes that each drone searches, in order.

    Args:
        ways: (N + K, N + K) moves between any two nodes, the N drones first.
        gains: (K,) expected finds of a search of each of the K other nodes.
        drones: N.
        time: Steps that a route may take; a search takes one.
    """
    end = len(ways)
    manager = pywrapcp.RoutingIndexManager(end + 1, drones, list(range(drones)), [end] * drones)
    routing = pywrapcp.RoutingModel(manager)
    # The search of a node counts as part of the way from it. Routes end at their last node.
    durations = np.zeros((end + 1, end + 1), int)
    durations[:end, :end] = ways
    durations[drones:end] += 1
    transit = routing.RegisterTransitMatrix(durations.tolist())
    routing.AddDimension(transit, 0, time, True, "time")
    times = routing.GetDimensionOrDie("time")
    # Of two routes with the same gain, the shorter one is better.
    routing.SetArcCostEvaluatorOfAllVehicles(transit)
    for k, gain in enumerate(gains):
        index = manager.NodeToIndex(drones + k)
        worth = round(MICRO * gain)
        routing.AddDisjunction([index], worth)
        # Sooner is better: a gain collected at the end counts half.
        times.SetCumulVarSoftUpperBound(index, 0, worth // (2 * time))
    parameters = pywrapcp.DefaultRoutingSearchParameters()
    parameters.first_solution_strategy = (
        routing_enums_pb2.FirstSolutionStrategy.PARALLEL_CHEAPEST_INSERTION
    )
    # Stop at a local optimum, not at a time limit, so that the same seed gives the same mission.
    parameters.local_search_metaheuristic = (
        routing_enums_pb2.LocalSearchMetaheuristic.GREEDY_DESCENT
    )
    parameters.lns_time_limit.seconds = _UNLIMITED_S
    solution = routing.SolveWithParameters(parameters)
    routes: list[list[int]] = [[] for _ in range(drones)]
    if solution is None:
        return routes
    for drone, route in enumerate(routes):
        index = solution.Value(routing.NextVar(routing.Start(drone)))
        while not routing.IsEnd(index):
            route.append(manager.IndexToNode(index))
            index = solution.Value(routing.NextVar(index))
    return routes

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

from dsse_ros.base.extras import pip_install
from dsse_ros.planners.belief import BeliefPlanner
from dsse_ros.planners.belief_routes import RoutesOnBelief
from dsse_ros.planners.effort_allocation import (
    SURE_LOOK,
    allocate,
    expected_finds,
    looks_of_search,
    reach_of,
)
from dsse_ros.planners.options import BeliefOptions
from dsse_ros.planners.planner import Cell, Search
from dsse_ros.search.belief.protocol import TargetBelief
from dsse_ros.world.scenario.actions import ActionSet

try:
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2
except ImportError as error:
    raise ImportError(f"{error}; {pip_install('routes')}") from error

STEPS_THERE = 15
"""Steps that a route takes after the drones have arrived, as many as `belief` plans ahead."""
CELLS_PER_DRONE = 12
"""Most likely cells per drone to choose from; the solver's matrices grow with their square."""
MICRO = 1_000_000
"""Scale of the gains: the solver takes whole numbers only."""
NEVER = 1_000_000
"""Steps to a cell that cannot be reached."""
_UNLIMITED_S = 86_400
"""Wall time for each part of the local search, which takes microseconds."""


class SolvedRoutes(RoutesOnBelief):
    """Flies the routes of a solver."""

    period = 3

    def plan(
        self, belief: TargetBelief, present: Sequence[Cell], steps: int, able: Sequence[ActionSet]
    ) -> list[list[Cell]]:
        """See `RoutesOnBelief.plan`; the routes are longer than the steps until the next plan."""
        likely = belief.poc()
        count, reach = CELLS_PER_DRONE * len(present), reach_of(able, present)
        chosen = list(allocate(likely, SURE_LOOK, count, reach))
        chosen = chosen or [present[0]]
        found = expected_finds(likely, looks_of_search(belief))
        gains = [float(found[row, col]) for col, row in chosen]
        nodes = [*present, *chosen]
        of_kinds = {actions: _ways(actions, nodes) for actions in able}
        ways = [of_kinds[actions] for actions in able]
        nearest = [min(of_drone[n][len(present) :]) for n, of_drone in enumerate(ways)]
        there = max((steps for steps in nearest if steps < NEVER), default=0)
        limit = belief.forecast.scenario.timestep_limit
        time = max(1, min(there + STEPS_THERE, limit - belief.step))
        return [
            [nodes[i] for i in route] or [cell]
            for route, cell in zip(
                solve(ways, gains, time, in_passing=self._in_passing), present, strict=True
            )
        ]


def make_route(search: Search, options: BeliefOptions, *, seed: int) -> BeliefPlanner:
    """Return the planner `route`: routes of a solver; see `RoutesOnBelief` for the seed."""
    return BeliefPlanner(search, SolvedRoutes, seed=seed, learn_drift=options.learn_drift)


def _ways(actions: ActionSet, nodes: Sequence[Cell]) -> list[list[int]]:
    """Return the moves between any two cells of a drone with these actions."""
    return [[_steps(actions.distance(a, b)) for b in nodes] for a in nodes]


def _steps(distance: int) -> int:
    return distance if distance >= 0 else NEVER


def solve(
    ways: Sequence[Sequence[Sequence[int]]],
    gains: Sequence[float],
    time: int,
    *,
    in_passing: bool = False,
) -> list[list[int]]:
    """Return the nodes that each drone searches, in order.

    Args:
        ways: (N, N + K, N + K) moves of each drone between any two nodes, the starts of the N
            drones first.
        gains: (K,) expected finds of a search of each of the K other nodes.
        time: Steps that a route may take; a search takes one, but in passing.
        in_passing: Whether drones look at the cells that they enter.
    """
    drones, end = len(ways), len(ways[0])
    manager = pywrapcp.RoutingIndexManager(end + 1, drones, list(range(drones)), [end] * drones)
    routing = pywrapcp.RoutingModel(manager)
    # The search of a node counts as part of the way from it. Routes end at their last node.
    durations = np.zeros((drones, end + 1, end + 1), int)
    durations[:, :end, :end] = ways
    durations[:, drones:end] += not in_passing
    transits = [routing.RegisterTransitMatrix(of_drone) for of_drone in durations.tolist()]
    routing.AddDimensionWithVehicleTransits(transits, 0, time, True, "time")
    times = routing.GetDimensionOrDie("time")
    for drone, transit in enumerate(transits):
        # Of two routes with the same gain, the shorter one is better.
        routing.SetArcCostEvaluatorOfVehicle(transit, drone)
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

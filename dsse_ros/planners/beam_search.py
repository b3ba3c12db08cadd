# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Beam search on a belief: plans where drones should go to find the persons soon.

The drones plan one after the other. Each plans for the scenarios that the other drones' plans leave
(sequential allocation). See `beam` for the value of a plan.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners import plan_kernels
from dsse_ros.planners.beam import plan_drone
from dsse_ros.planners.options import OF_PARTICLES, SAMPLES, BeamOptions
from dsse_ros.planners.planner import DecisionPoint, Plans, as_plan
from dsse_ros.search.belief.forecasts import is_ensemble
from dsse_ros.search.belief.motion_kernels import MARGIN
from dsse_ros.search.belief.protocol import LooksToCome, Outlook, TargetBelief, TargetForecast
from dsse_ros.search.environments.ways_home import ways_home
from dsse_ros.search.step.looks import Looks, looks_of
from dsse_ros.world.scenario.action_times import (
    ActionTimes,
    action_times_of_drones,
    action_times_of_kinds,
)
from dsse_ros.world.scenario.actions import Cell
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario
from dsse_ros.world.scenario.swarm import Swarm, number_of
from dsse_ros.world.targets.registry import has_own_drift

CLOSENESS = 0.7
"""Factor on the worth of a scenario left at the end of a plan for each move to it."""
WARM_DRONES = 4
"""With up to so many drones, each allows for the last plans of the drones that plan after it."""
FINALISTS, FINALISTS_OF_ALL = 8, 32
"""Plans of a drone, and of all drones, that the exact filter compares in a step."""


def steps_planned(rules: Rules, horizon: int | None) -> int:
    """Return how many steps plans look ahead, by default fewer if each person has its own drift.

    Args:
        rules: The rules of the search.
        horizon: Of `BeamOptions`; None for the default.
    """
    return horizon or (10 if has_own_drift(rules.person_motion) else 15)


def num_finalists(rules: Rules, num_drones: int) -> int:
    """Return among how many of a beam's plans, besides the last plan, the exact filter chooses.

    The samples overrate a plan that was optimized on them. If each person has its own drift, the
    samples decide: the exact filter would cost as many times as much as there are drift samples,
    for no gain.
    """
    if has_own_drift(rules.person_motion):
        return 1
    return max(min(FINALISTS, FINALISTS_OF_ALL // num_drones), 1)


def _moves_of_kinds(
    swarm: Swarm, looks: Looks, padded: GridShape, times: Sequence[ActionTimes]
) -> list[plan_kernels.Moves]:
    """Return the moves of each kind of drone; all kinds number their moves and looks alike."""
    steps = [(0, 0), *swarm.actions.steps]
    actions = [swarm.actions.action((0, 0), step) for step in steps]
    rows: list[int] = []
    starts = np.zeros((len(looks.starts), len(actions) + 1), np.int64)
    for kind, of_kind in enumerate(looks.starts):
        starts[kind, 0] = len(rows)
        for a, action in enumerate(actions):
            rows += range(of_kind[action], of_kind[action + 1])
            starts[kind, a + 1] = len(rows)
    y, x = np.indices(padded.matrix).reshape(2, -1)
    between = [np.minimum(np.abs(np.arange(2 * size) - size), size - 1) for size in padded.matrix]
    nearness = [
        CLOSENESS ** able.distances((0, 0), padded, as_if_open=True).astype(np.float64)
        for able in swarm.of_kinds
    ]
    return [
        plan_kernels.Moves(
            steps=np.array([dy * padded.columns + dx for dx, dy in steps]),
            able=np.array([step in ((0, 0), *able.steps) for step in steps]),
            starts=starts[kind],
            offsets=looks.offsets[rows],
            pods=looks.pods[rows],
            nearness=nearness[kind],
            positions=y * 2 * padded.columns + x,
            around=(nearness[kind][np.ix_(*between)] * plan_kernels.UNIT).astype(np.int64).ravel(),
            extra=np.array(times[kind].takes)[actions] - 1.0,
            rest=np.array(times[kind].after)[actions],
        )
        for kind, able in enumerate(swarm.of_kinds)
    ]


def _fleet_of(kinds: Sequence[plan_kernels.Moves]) -> plan_kernels.PlannedFleet:
    """Return a fleet of one drone of each kind."""
    return plan_kernels.PlannedFleet(
        kinds=np.arange(len(kinds)), steps=kinds[0].steps,
        starts=np.stack([kind.starts for kind in kinds]), offsets=kinds[0].offsets,
        extra=np.stack([kind.extra for kind in kinds]),
        rest=np.stack([kind.rest for kind in kinds]), padded=GridShape.of(kinds[0].nearness),
    )  # fmt: skip


class Reach:
    """How far the drones can fly and still come home with their battery reserve.

    Args:
        scenario: A scenario with batteries.
        rules: The rules of the search.
    """

    def __init__(self, scenario: ResolvedScenario, rules: Rules) -> None:
        actions, mask = rules.action_set, scenario.area_mask
        shares = [times.shares for times in action_times_of_drones(scenario, rules)]
        ways = ways_home(actions, mask, scenario.grid_size, scenario.drones_positions, shares)
        self._home = ways.steps * scenario.battery_return + scenario.battery_reserve
        # A planned step may be a move or a search, so it counts as the one that costs more.
        self._step = max(scenario.battery_move, scenario.battery_search)

    def beyond(self, drone: int, battery: float, steps: int) -> NDArray[np.bool_]:
        """Return the cells from which a drone may not get home after steps 1, 2, ..., (H, R, C).

        Args:
            drone: Number of the drone.
            battery: Its charge, percent.
            steps: H.
        """
        left = battery - self._step * np.arange(1, steps + 1)
        beyond: NDArray[np.bool_] = left[:, None, None] < self._home[drone]
        return beyond


@dataclass
class PlannedPath:
    """The plan of a drone."""

    path: NDArray[np.int64]
    """(H + 1,) columns of the belief, the present one first."""
    length: int


class BeamSearch:
    """Plans for the drones of one mission.

    Args:
        forecast: Forecast of the mission; its horizon limits the plans, see `BeamOptions.horizon`.
        options: Options of the search.
        seed: Seed for drawing the scenarios.

    Attributes:
        drawn: Whether its seed has made a difference so far.
    """

    def __init__(self, forecast: TargetForecast, options: BeamOptions, *, seed: int = 0) -> None:
        self._forecast = forecast
        self._options = options
        num_drones = forecast.scenario.num_drones
        self._finalists = num_finalists(forecast.rules, num_drones)
        self._samples = options.samples or (
            OF_PARTICLES if is_ensemble(forecast.rules) else SAMPLES
        )
        self._rng = np.random.default_rng(seed)
        self._swarm = Swarm.of_scenario(forecast.scenario, forecast.rules)
        looks = looks_of(forecast.scenario, forecast.rules)
        times = action_times_of_kinds(forecast.scenario, forecast.rules)
        self._kinds = _moves_of_kinds(self._swarm, looks, forecast.padded, times)
        self._fleet = _fleet_of(self._kinds)
        self._most_looks = max(int(np.diff(self._fleet.starts, axis=1).max()), 1)
        self._sure = not (self._kinds[0].pods < 1.0).any()
        self._measure = forecast.rules.action_set.distance
        grid = forecast.scenario.grid_size
        area = np.ones(grid.matrix, np.bool_) if forecast.area is None else forecast.area
        self._masked = ~np.pad(area, MARGIN).ravel()
        self._plans: dict[Hashable, PlannedPath] = {}
        self._reach: Reach | None = None
        self.drawn = False

    def copy(self) -> BeamSearch:
        """Return an independent copy in the same state."""
        twin = copy.copy(self)
        twin._rng = copy.deepcopy(self._rng)
        twin._plans = dict(self._plans)
        return twin

    def with_seed(self, seed: int) -> BeamSearch:
        """Return a copy that draws with this seed."""
        twin = self.copy()
        twin._rng = np.random.default_rng(seed)
        return twin

    def plans(self) -> Plans:
        """See `Planning`."""
        return {
            agent: as_plan([self._forecast.cell(int(c)) for c in plan.path[1 : plan.length + 1]])
            for agent, plan in self._plans.items()
        }

    def __call__(self, at: DecisionPoint) -> list[Cell]:
        """Return the next cell of each drone; its present cell means a search there.

        The tactic keeps the last plans by agent. Plans leave enough charge to return.
        """
        belief, agents, present, deadline_s, batteries = at
        options, forecast = self._options, self._forecast
        if options.budget_ms is not None:
            deadline_s = min(deadline_s, time.monotonic() + options.budget_ms / 1000)
        left = forecast.scenario.timestep_limit - belief.step
        horizon = max(1, min(forecast.horizon, left))
        scenarios = self._scenarios(belief, horizon)
        outlook = belief.outlook(horizon, options.gamma) if self._finalists > 1 else None
        plans = self._last_plans(agents, present, horizon)
        warm = len(agents) <= WARM_DRONES
        credits = np.zeros((len(agents), self._samples))
        kinds = np.array([self._swarm.kind_of(agent) for agent in agents])
        fleet = self._fleet._replace(kinds=kinds)

        def credit(n: int) -> None:
            moves, plan = self._kinds[kinds[n]], plans[n]
            plan_kernels.credit_plan(
                moves, scenarios, plan.path, plan.length, options.gamma, credits[n]
            )

        for n, plan in enumerate(plans):
            if warm and plan.length:
                credit(n)
        beyond = self._beyond(agents, batteries, horizon)
        planned: set[int] = set()
        for n in self._order(belief, present):
            if planned and time.monotonic() > deadline_s:
                break
            paths = np.full((self._finalists + 1, horizon + 1), forecast.column(present[n]))
            blocked = self._blocked(n, plans, planned, horizon)
            if beyond:
                blocked |= beyond[n]
            credits[n] = 0.0
            found, length = plan_drone(
                self._kinds[kinds[n]], scenarios, options.gamma, options.kappa, options.width,
                credits, blocked, paths[:-1],
            )  # fmt: skip
            lengths, best = np.full(found + 1, length), 0
            if outlook is not None:
                last, counted = plans[n], range(len(plans)) if warm else sorted(planned)
                if last.length and not blocked[np.arange(horizon), last.path[1:]].any():
                    paths[found], lengths[found] = last.path, horizon
                    found += 1
                candidates = paths[:found], lengths[:found]
                best = self._best(outlook, plans, fleet, n, candidates, counted)
            plans[n] = PlannedPath(paths[best], int(lengths[best]))
            planned.add(n)
            credit(n)
        first = self._first_cells(plans, planned)
        self._plans = dict(zip(agents, plans, strict=True))
        return first

    def _best(
        self,
        outlook: Outlook,
        plans: Sequence[PlannedPath],
        fleet: plan_kernels.PlannedFleet,
        drone: int,
        candidates: tuple[NDArray[np.int64], NDArray[np.int64]],
        counted: Sequence[int],
    ) -> int:
        """Return the number of the candidate that the outlook rates best, given the counted plans.

        Args:
            outlook: Of the belief.
            plans: Of all drones.
            fleet: The drones.
            drone: The drone that plans.
            candidates: (V, H + 1) paths and (V,) lengths.
            counted: Numbers of the other drones whose plans count.
        """
        moves, (own_paths, own_lengths) = self._kinds[fleet.kinds[drone]], candidates
        paths = np.repeat(np.stack([plan.path for plan in plans])[None], len(own_paths), axis=0)
        counts = [plan.length if n in counted else 0 for n, plan in enumerate(plans)]
        lengths = np.repeat(np.array(counts)[None], len(own_paths), axis=0)
        paths[:, drone], lengths[:, drone] = own_paths, own_lengths
        starts = np.empty(len(paths) + 1, np.int64)
        looks = np.empty((3, paths.size * self._most_looks), np.int64)
        plan_kernels.looks_of_plans(fleet, paths, lengths, starts, looks)
        steps, columns, rows = looks[:, : starts[-1]]
        expected = outlook(LooksToCome(starts, steps, columns, moves.pods[rows]))
        worth = np.empty(len(paths))
        plan_kernels.worth_of_left(expected.left, moves.nearness, own_paths[:, -1], worth)
        return int(np.argmax(expected.finds + self._options.kappa * worth))

    def _scenarios(self, belief: TargetBelief, horizon: int) -> plan_kernels.Scenarios:
        """Return futures of the persons, sorted by cell."""
        self.drawn = True
        futures = belief.futures(self._samples, horizon, self._rng)
        draws = np.zeros((0, 0)) if self._sure else self._rng.random((horizon, self._samples))
        return plan_kernels.Scenarios(
            persons=futures.persons, draws=draws, starts=futures.starts, members=futures.members,
            ends=futures.cells[-1],
        )  # fmt: skip

    def _last_plans(
        self, agents: Sequence[Hashable], present: Sequence[Cell], horizon: int
    ) -> list[PlannedPath]:
        """Return each drone's last plan without the step just done; an empty one if it has none."""
        plans = []
        for agent, cell in zip(agents, present, strict=True):
            path = np.full(horizon + 1, self._forecast.column(cell))
            last, length = self._plans.get(agent), 0
            if last is not None and last.length > 1 and last.path[1] == path[0]:
                length = min(last.length - 1, horizon)
                path[: length + 1] = last.path[1 : length + 2]
                path[length + 1 :] = path[length]
            elif last is not None and last.length and last.path[0] == path[0]:
                # It is under way, or was held up.
                length = min(last.length, horizon)
                path[: length + 1] = last.path[: length + 1]
                path[length + 1 :] = path[length]
            plans.append(PlannedPath(path, length))
        return plans

    def _order(self, belief: TargetBelief, present: Sequence[Cell]) -> list[int]:
        """Return the drones in order of their distance to the belief's mean."""
        cells = belief.poc()
        total = max(float(cells.sum()), 1e-300)
        rows, cols = map(np.arange, cells.shape)
        mean = (
            round(float(cells.sum(axis=0) @ cols) / total),
            round(float(cells.sum(axis=1) @ rows) / total),
        )
        return sorted(range(len(present)), key=lambda n: self._measure(present[n], mean))

    def _blocked(
        self, drone: int, plans: Sequence[PlannedPath], planned: set[int], horizon: int
    ) -> NDArray[np.bool_]:
        """Return the cells (H, S) that a drone must keep out of.

        They are the cells outside the area and, if drones collide, those of other drones.
        A drone that has not planned may stay where it is, so staying is always safe.
        """
        blocked = np.repeat(self._masked[None], horizon, axis=0)
        if self._forecast.rules.collisions:
            for n, plan in enumerate(plans):
                if n == drone:
                    continue
                if n in planned:
                    blocked[np.arange(horizon), plan.path[1 : horizon + 1]] = True
                else:
                    blocked[0, plan.path[0]] = True
        return blocked

    def _beyond(
        self, agents: Sequence[Hashable], batteries: Sequence[float], horizon: int
    ) -> list[NDArray[np.bool_]]:
        """Return the cells (H, S) that are out of each drone's reach; empty without batteries."""
        if not batteries:
            return []
        if self._reach is None:
            self._reach = Reach(self._forecast.scenario, self._forecast.rules)
        around = ((0, 0), (MARGIN, MARGIN), (MARGIN, MARGIN))
        return [
            np.pad(self._reach.beyond(number_of(agent), battery, horizon), around).reshape(
                horizon, -1
            )
            for agent, battery in zip(agents, batteries, strict=True)
        ]

    def _first_cells(self, plans: list[PlannedPath], planned: set[int]) -> list[Cell]:
        """Return the next cells of the plans; drones that have not planned give way."""
        taken = {int(plans[n].path[1]) for n in planned}
        for n, plan in enumerate(plans):
            if n in planned:
                continue
            waiting = {int(p.path[0]) for m, p in enumerate(plans) if m not in planned and m != n}
            if self._forecast.rules.collisions and int(plan.path[1]) in taken | waiting:
                plans[n] = plan = PlannedPath(np.full_like(plan.path, plan.path[0]), 0)
            taken.add(int(plan.path[1]))
        return [self._forecast.cell(int(plan.path[1])) for plan in plans]

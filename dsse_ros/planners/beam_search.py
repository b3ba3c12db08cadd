# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Beam search on a belief: plans where drones should go to find the persons soon.

The drones plan one after the other. Each plans for the scenarios that the other drones' plans leave
(sequential allocation). See `beam` for the value of a plan.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.belief.belief_kernels import MARGIN
from dsse_ros.belief.future_kernels import index
from dsse_ros.belief.protocol import LooksToCome, TargetBelief, TargetForecast
from dsse_ros.planners import beam
from dsse_ros.planners.planner import DecisionPoint, number_of
from dsse_ros.planners.reach import Reach
from dsse_ros.scenario.actions import ACTION_VECTORS, DIAGONAL, STRAIGHT, Cell
from dsse_ros.scenario.rules import Rules
from dsse_ros.step.looks import Looks, looks_of
from dsse_ros.targets.registry import has_own_drift


@dataclass(frozen=True, kw_only=True)
class BeamOptions:
    """Options of the beam search.

    Attributes:
        samples: M, scenarios drawn from the belief.
        horizon: H, steps planned; None: see `BY_DRIFT`.
        width: W, nodes kept at each step.
        cap: Nodes kept at each step in one cell.
        gamma: Discount of a find per step.
        kappa: Weight of the scenarios left at the end of a plan.
        closeness: g, factor on the worth of a remaining scenario for each move to it.
        drift_samples: K, angles of the persons' own drift, see `Forecast`.
        finalists: Number of a beam's plans, in addition to the drone's last plan, among which the
            exact filter chooses: the samples overrate a plan that was optimized on them. 1: the
            samples decide. None: see `BY_DRIFT`, but at most `FINALISTS` for all drones together.
        warm_start: Whether a drone allows for the last plans of the drones that plan after it.
            None: with up to 4 drones.
        passes: How often each drone plans in a step.
        budget_ms: Wall time of a step after which no further drone plans; the others continue
            their last plans. None: no limit, so that the same seed gives the same mission.
    """

    samples: int = 4096
    horizon: int | None = None
    width: int = 32
    cap: int = 4
    gamma: float = 0.95
    kappa: float = 0.2
    closeness: float = 0.7
    drift_samples: int = 16
    finalists: int | None = None
    warm_start: bool | None = None
    passes: int = 1
    budget_ms: float | None = None

    def completed(self, rules: Rules) -> BeamOptions:
        """Return the options, with the defaults that depend on the rules filled in."""
        given = {name: value for name, value in vars(self).items() if value is not None}
        own_drift = has_own_drift(rules.person_motion)
        return replace(self, **{**BY_DRIFT[own_drift], **given})


BY_DRIFT: Mapping[bool, Mapping[str, Any]] = {
    # Persons stay near the datum, so look further ahead, and small differences count. The exact
    # filter is also cheap for an ensemble.
    False: {"horizon": 15, "finalists": 8},
    # If each person has its own drift, the exact filter costs K times as much, for no gain.
    True: {"horizon": 10, "finalists": 1},
}
"""Default options, by whether each person has a drift of its own."""

FINALISTS = 32
"""Plans of all drones together that the exact filter compares in a step."""


class _Scenarios(NamedTuple):
    """Futures, as arguments of `beam`."""

    persons: NDArray[np.int64]
    draws: NDArray[np.float64]
    starts: NDArray[np.int64]
    members: NDArray[np.int64]


class _BeamLooks(NamedTuple):
    """The looks of the beam's moves, as arguments of `beam`, with `first` by kind of drone."""

    first: NDArray[np.int64]
    offsets: NDArray[np.int64]
    pods: NDArray[np.float64]

    @classmethod
    def of(cls, looks: Looks, actions: Sequence[int]) -> _BeamLooks:
        """Return the looks of these actions, in their order."""
        rows: list[int] = []
        first = np.zeros((len(looks.first), len(actions) + 1), np.int64)
        for kind, of_kind in enumerate(looks.first):
            first[kind, 0] = len(rows)
            for a, action in enumerate(actions):
                rows += range(of_kind[action], of_kind[action + 1])
                first[kind, a + 1] = len(rows)
        return cls(first, looks.offsets[rows], looks.pods[rows])

    @property
    def most(self) -> int:
        """Largest number of looks of a move."""
        return max(int(np.diff(self.first, axis=1).max()), 1)

    def of_kind(self, kind: int) -> _BeamLooks:
        """Return the arguments of `beam` for a kind of drone."""
        return self._replace(first=self.first[kind])


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
        self._options = full = options.completed(forecast.rules)
        assert full.finalists is not None
        self._finalists = full.finalists
        if options.finalists is None:
            self._finalists = min(full.finalists, max(FINALISTS // forecast.scenario.num_drones, 1))
        self._rng = np.random.default_rng(seed)
        side = forecast.side
        actions = forecast.rules.action_set.with_moves()
        self._measure = actions.distance
        names = (*STRAIGHT, *(DIAGONAL if actions.diagonal else ()))
        steps = [(0, 0), *(ACTION_VECTORS[name] for name in names)]
        self._moves = np.array([dy * side + dx for dx, dy in steps])
        self._kinds = looks_of(forecast.scenario, forecast.rules)
        self._looks = _BeamLooks.of(self._kinds, [actions.action((0, 0), step) for step in steps])
        self._masked = np.zeros(side**2, np.bool_)
        if forecast.area is not None:
            self._masked = ~np.pad(forecast.area, MARGIN).ravel()
        away = actions.distances((0, 0), side).astype(np.float64)
        self._nearness: NDArray[np.float64] = options.closeness**away
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
        ends, scenarios = self._scenarios(belief, horizon)
        plans = self._last_plans(agents, present, horizon)
        warm = len(agents) <= 4 if options.warm_start is None else options.warm_start
        credits = np.zeros((len(agents), options.samples))
        kinds = self._kinds.kind[[number_of(agent) for agent in agents]]

        def credit(n: int) -> None:
            beam.credit_plan(
                plans[n].path, plans[n].length, options.gamma, forecast.side,
                self._moves, *self._looks.of_kind(kinds[n]), *scenarios, credits[n],
            )  # fmt: skip

        for n, plan in enumerate(plans):
            if warm and plan.length:
                credit(n)
        beyond = self._beyond(agents, batteries, horizon)
        planned: set[int] = set()
        for n in self._order(belief, present) * options.passes:
            if planned and time.monotonic() > deadline_s:
                break
            paths = np.full((self._finalists, horizon + 1), self._forecast.column(present[n]))
            blocked = self._blocked(n, plans, planned, horizon)
            if beyond:
                blocked |= beyond[n]
            found, length = beam.plan_drone(
                self._moves, *self._looks.of_kind(kinds[n]), *scenarios,
                options.width, options.cap, options.gamma, options.kappa, self._nearness, ends,
                credits, n, blocked, horizon, paths,
            )  # fmt: skip
            candidates = [PlannedPath(path, length) for path in paths[:found]]
            if plans[n].length and not blocked[np.arange(horizon), plans[n].path[1:]].any():
                candidates.append(PlannedPath(plans[n].path, horizon))
            counted = range(len(plans)) if warm else sorted(planned)
            plans[n] = self._best(belief, plans, kinds, n, candidates, counted)
            planned.add(n)
            credit(n)
        first = self._first_cells(plans, planned, present)
        self._plans = dict(zip(agents, plans, strict=True))
        return first

    def _best(
        self,
        belief: TargetBelief,
        plans: Sequence[PlannedPath],
        kinds: NDArray[np.int64],
        drone: int,
        candidates: Sequence[PlannedPath],
        counted: Sequence[int],
    ) -> PlannedPath:
        """Return the candidate that the exact filter rates best, given the counted plans."""
        options = self._options
        if self._finalists == 1:
            return candidates[0]
        together = np.stack([plan.path for plan in plans])
        lengths = np.array([p.length if n in counted else 0 for n, p in enumerate(plans)])

        horizon, looks = together.shape[1] - 1, self._looks
        steps, columns, rows = np.empty((3, together.size * looks.most), np.int64)

        def value(candidate: PlannedPath) -> float:
            together[drone], lengths[drone] = candidate.path, candidate.length
            count = beam.looks_of_plans(
                together, lengths, kinds, self._moves, looks.first, looks.offsets,
                self._forecast.side, steps, columns, rows,
            )  # fmt: skip
            to_come = LooksToCome(steps[:count], columns[:count], looks.pods[rows[:count]])
            expected = belief.expect(to_come, horizon, options.gamma)
            left = beam.worth_of_left(expected.left, self._nearness, candidate.path[-1])
            return expected.finds + options.kappa * float(left)

        return max(candidates, key=value)

    def _scenarios(
        self, belief: TargetBelief, horizon: int
    ) -> tuple[NDArray[np.int64], _Scenarios]:
        """Return the last cells of the futures, (M,), and the futures sorted by cell."""
        count = self._options.samples
        self.drawn = True
        cells, persons = belief.futures(count, horizon, self._rng)
        draws = np.zeros((0, 0))
        if (self._looks.pods < 1.0).any():
            draws = self._rng.random((horizon, count))
        starts = np.empty((horizon, self._forecast.side**2 + 1), np.int64)
        members = np.empty((horizon, count), np.int64)
        index(cells, starts, members)
        return cells[-1], _Scenarios(persons, draws, starts, members)

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
            plans.append(PlannedPath(path, length))
        return plans

    def _order(self, belief: TargetBelief, present: Sequence[Cell]) -> list[int]:
        """Return the drones in order of their distance to the belief's mean."""
        cells = belief.poc()
        total = max(float(cells.sum()), 1e-300)
        line = np.arange(len(cells))
        mean = (
            round(float(cells.sum(axis=0) @ line) / total),
            round(float(cells.sum(axis=1) @ line) / total),
        )
        return sorted(range(len(present)), key=lambda n: self._measure(present[n], mean))

    def _blocked(
        self, drone: int, plans: Sequence[PlannedPath], planned: set[int], horizon: int
    ) -> NDArray[np.bool_]:
        """Return the cells (H, S S) that a drone must keep out of.

        They are the cells outside the area and, if drones collide, those of other drones.
        A drone that has not planned may stay where it is, so staying is always safe.
        """
        blocked = np.tile(self._masked, (horizon, 1))
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
        """Return the cells (H, S S) that are out of each drone's reach; empty without batteries."""
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

    def _first_cells(
        self, plans: list[PlannedPath], planned: set[int], present: Sequence[Cell]
    ) -> list[Cell]:
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

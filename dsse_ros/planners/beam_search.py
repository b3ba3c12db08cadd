# SPDX-License-Identifier: Apache-2.0
"""Beam search on a belief: where drones should go to find the persons soon.

The drones plan one after the other, each for the scenarios that the plans of the others leave
(sequential allocation). See `beam` for what a plan is worth.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners import beam
from dsse_ros.search.actions import ACTION_VECTORS, DIAGONAL, STRAIGHT, Cell
from dsse_ros.search.belief import Belief, Forecast
from dsse_ros.search.belief_kernels import MARGIN
from dsse_ros.search.rules import Rules


@dataclass(frozen=True, kw_only=True)
class BeamOptions:
    """How a plan is searched.

    Attributes:
        samples: M, scenarios drawn from the belief.
        horizon: H, steps planned; None: 15 where persons stay about the datum, else 10.
        width: W, nodes kept at each step.
        cap: Nodes kept at each step in one cell.
        gamma: Discount of a find per step.
        kappa: Weight of the scenarios left at the end of a plan.
        closeness: g, what a scenario left loses of its worth with each move it is away.
        drift_samples: K, angles of the persons' own drift, see `Forecast`.
        warm_start: Whether a drone allows for the last plans of those that plan after it; None:
            with up to 4 drones.
        passes: How often each drone plans in a step.
        budget_ms: Wall time of a step after which no more plans are searched: drones go on with
            the last ones. None: no limit, so that the same seed gives the same mission.
    """

    samples: int = 4096
    horizon: int | None = None
    width: int = 32
    cap: int = 4
    gamma: float = 0.95
    kappa: float = 0.2
    closeness: float = 0.7
    drift_samples: int = 16
    warm_start: bool | None = None
    passes: int = 1
    budget_ms: float | None = None

    def horizon_by(self, rules: Rules) -> int:
        """Return the horizon where these rules hold."""
        if self.horizon is not None:
            return self.horizon
        return {"window": 15, "drift": 10}[rules.person_motion]


@dataclass
class _Plan:
    path: NDArray[np.int64]
    """(H + 1,) columns of the belief, the present one first."""
    length: int


class BeamSearch:
    """Plans of the drones of one mission.

    Args:
        forecast: Its horizon is how far plans reach, see `BeamOptions.horizon_by`.
        options: How a plan is searched.
        seed: Of the scenarios.
    """

    def __init__(self, forecast: Forecast, options: BeamOptions, *, seed: int = 0) -> None:
        self._forecast = forecast
        self._options = options
        self._rng = np.random.default_rng(seed)
        self._side = forecast.scenario.grid_size + 2 * MARGIN
        actions = forecast.rules.action_set.with_moves()
        self._measure = actions.distance
        names = (*STRAIGHT, *(DIAGONAL if actions.diagonal else ()))
        steps = [(0, 0), *(ACTION_VECTORS[name] for name in names)]
        self._moves = np.array([dy * self._side + dx for dx, dy in steps])
        away = np.arange(self._side)
        across, down = np.meshgrid(away, away)
        moves = np.maximum(across, down) if actions.diagonal else across + down
        self._nearness: NDArray[np.float64] = options.closeness ** moves.astype(np.float64)
        self._plans: dict[Hashable, _Plan] = {}

    def copy(self) -> BeamSearch:
        """Return one that goes on by itself from here."""
        twin = copy.copy(self)
        twin._rng = copy.deepcopy(self._rng)
        twin._plans = dict(self._plans)
        return twin

    def __call__(
        self, belief: Belief, agents: Sequence[Hashable], present: Sequence[Cell]
    ) -> list[Cell]:
        """Return the cell that each drone goes to; its own one means that it searches it.

        Args:
            belief: Before the step's searches.
            agents: The live drones; their last plans are known by them.
            present: Their cells.
        """
        began = time.perf_counter()
        options, forecast = self._options, self._forecast
        left = forecast.scenario.timestep_limit - belief.step
        horizon = max(1, min(forecast.horizon, left))
        cells, starts, members = self._scenarios(belief, horizon)
        plans = self._last_plans(agents, present, horizon)
        warm = len(agents) <= 4 if options.warm_start is None else options.warm_start
        credits = np.zeros((len(agents), options.samples))
        for n, plan in enumerate(plans):
            if warm and plan.length:
                beam.credit_plan(plan.path, plan.length, options.gamma, starts, members, credits[n])
        planned: set[int] = set()
        for n in self._order(belief, present) * options.passes:
            spent_ms = 1000 * (time.perf_counter() - began)
            if options.budget_ms is not None and spent_ms > options.budget_ms and planned:
                break
            path = np.empty(horizon + 1, np.int64)
            path[0] = self._column(present[n])
            length = beam.plan_drone(
                self._moves, options.width, options.cap, options.gamma, options.kappa,
                self._nearness, starts, members, cells[-1], credits, n,
                self._blocked(n, plans, planned, horizon), horizon, path,
            )  # fmt: skip
            plans[n] = _Plan(path, length)
            planned.add(n)
            beam.credit_plan(path, length, options.gamma, starts, members, credits[n])
        ends = self._first_cells(plans, planned, present)
        self._plans = dict(zip(agents, plans, strict=True))
        return ends

    def _scenarios(
        self, belief: Belief, horizon: int
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Return `cells` of `beam.roll`, `starts` and `members` of `beam.index`."""
        forecast, count = self._forecast, self._options.samples
        first = belief.step + forecast.first_step
        forecast.look(first)
        slots = np.arange(first, first + horizon) % len(forecast.directions)
        offset, *offsets = self._rng.random(horizon + 1)
        rows = np.empty(count, np.int64)
        cells = np.empty((horizon + 1, count), np.int64)
        beam.sample(belief.density, count, offset, rows, cells[0])
        beam.roll(
            forecast.constants, forecast.chances, forecast.tables, forecast.directions, slots,
            np.array(offsets), rows, cells,
        )  # fmt: skip
        detected = np.zeros((0, 0), np.bool_)
        if belief.pods.min() < 1.0:
            pods = belief.pods[rows // forecast.directions.shape[1]]
            detected = self._rng.random((horizon, count)) < pods
        starts = np.empty((horizon, self._side**2 + 1), np.int64)
        members = np.empty((horizon, count), np.int64)
        beam.index(cells, detected, starts, members)
        return cells, starts, members

    def _last_plans(
        self, agents: Sequence[Hashable], present: Sequence[Cell], horizon: int
    ) -> list[_Plan]:
        """Return each drone's last plan less the step that was done, empty where it has none."""
        plans = []
        for agent, cell in zip(agents, present, strict=True):
            path = np.full(horizon + 1, self._column(cell))
            last, length = self._plans.get(agent), 0
            if last is not None and last.length > 1 and last.path[1] == path[0]:
                length = min(last.length - 1, horizon)
                path[: length + 1] = last.path[1 : length + 2]
                path[length + 1 :] = path[length]
            plans.append(_Plan(path, length))
        return plans

    def _order(self, belief: Belief, present: Sequence[Cell]) -> list[int]:
        """Return the drones, those nearest to the belief's mean first."""
        cells = belief.cells()
        total = max(float(cells.sum()), 1e-300)
        line = np.arange(len(cells))
        mean = (
            round(float(cells.sum(axis=0) @ line) / total),
            round(float(cells.sum(axis=1) @ line) / total),
        )
        return sorted(range(len(present)), key=lambda n: self._measure(present[n], mean))

    def _blocked(
        self, drone: int, plans: Sequence[_Plan], planned: set[int], horizon: int
    ) -> NDArray[np.bool_]:
        """Return the cells (H, S S) that a drone must keep out of, where drones collide.

        A drone that has not planned may stay where it is, so that staying is always safe.
        """
        blocked = np.zeros((horizon, self._side**2), np.bool_)
        if self._forecast.rules.collisions:
            for n, plan in enumerate(plans):
                if n == drone:
                    continue
                if n in planned:
                    blocked[np.arange(horizon), plan.path[1 : horizon + 1]] = True
                else:
                    blocked[0, plan.path[0]] = True
        return blocked

    def _first_cells(
        self, plans: list[_Plan], planned: set[int], present: Sequence[Cell]
    ) -> list[Cell]:
        """Return where the plans lead now; a drone that has not planned stays out of the way."""
        taken = {int(plans[n].path[1]) for n in planned}
        for n, plan in enumerate(plans):
            if n in planned:
                continue
            waiting = {int(p.path[0]) for m, p in enumerate(plans) if m not in planned and m != n}
            if self._forecast.rules.collisions and int(plan.path[1]) in taken | waiting:
                plans[n] = plan = _Plan(np.full_like(plan.path, plan.path[0]), 0)
            taken.add(int(plan.path[1]))
        return [self._cell(int(plan.path[1])) for plan in plans]

    def _column(self, cell: Cell) -> int:
        return (cell[1] + MARGIN) * self._side + cell[0] + MARGIN

    def _cell(self, column: int) -> Cell:
        row, col = divmod(column, self._side)
        return col - MARGIN, row - MARGIN

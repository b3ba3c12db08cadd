# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Routes planned on the belief, flown for some steps, and planned again."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

from dsse_ros.planners.planner import Cell, DecisionPoint, Plans
from dsse_ros.planners.route_guidance import RouteGuidance
from dsse_ros.search.belief.protocol import TargetBelief, TargetForecast
from dsse_ros.search.step.looks import looks_of, moves_look
from dsse_ros.world.scenario.actions import ActionSet
from dsse_ros.world.scenario.swarm import Swarm

if TYPE_CHECKING:
    from typing_extensions import Self


class RoutesOnBelief(ABC):
    """A `Tactic` that flies routes and replans them every few steps, or when live drones change.

    Args:
        forecast: Forecast of the mission.
        seed: Seed for the choice of the cell to step aside to when a route is blocked.

    Attributes:
        period: Steps between two plans.
        drawn: See `Shareable`.
    """

    period: ClassVar[int]

    def __init__(self, forecast: TargetForecast, *, seed: int = 0) -> None:
        self._swarm = Swarm.of_scenario(forecast.scenario, forecast.rules)
        self._limit = forecast.scenario.timestep_limit
        looks = looks_of(forecast.scenario, forecast.rules)
        self._in_passing = moves_look(looks, forecast.rules)
        self._seed = seed
        self._guidance: RouteGuidance | None = None
        self._agents: list[Hashable] = []
        self._planned_at = 0
        self.drawn = False

    @abstractmethod
    def plan(
        self, belief: TargetBelief, present: Sequence[Cell], steps: int, able: Sequence[ActionSet]
    ) -> Sequence[Sequence[Cell]]:
        """Return a route for each drone: the cells to search in order, at least one.

        A cell to search twice is listed twice. If drones look in passing, entering it is a search.

        Args:
            belief: The belief.
            present: Cells of the drones.
            steps: Steps until the next plan.
            able: Actions of each drone in the area.
        """

    def copy(self) -> Self:
        """Return an independent copy in the same state."""
        twin = copy.copy(self)
        twin._guidance = None if self._guidance is None else self._guidance.copy()
        return twin

    def with_seed(self, seed: int) -> Self:
        """Return a copy that draws with this seed."""
        twin = copy.copy(self)
        twin._seed = seed
        if self._guidance is not None:
            twin._guidance = self._guidance.with_seed(seed + self._planned_at)
        return twin

    def plans(self) -> Plans:
        """See `Planning`."""
        return {} if self._guidance is None else self._guidance.plans()

    def __call__(self, at: DecisionPoint) -> list[Cell]:
        """Return the cell that each drone goes to; see `Tactic`."""
        belief, agents, present, *_ = at
        due = belief.step >= self._planned_at + self.period or list(agents) != self._agents
        if self._guidance is None or due:
            steps = max(1, min(self.period, self._limit - belief.step))
            routes = self.plan(belief, present, steps, self._swarm.actions_of(agents))
            if self._in_passing:
                # A drone has entered its own cell before.
                routes = [
                    [cell, *route] if route[0] == cell else route
                    for cell, route in zip(present, routes, strict=True)
                ]
            # `BeliefPlanner` keeps drones under way apart.
            self._guidance = RouteGuidance(
                replace(self._swarm, may_be_under_way=False), seed=self._seed + belief.step,
                in_passing=self._in_passing,
            )  # fmt: skip
            self._guidance.start(agents, routes, belief.forecast.scenario.grid_size)
            self._agents, self._planned_at = list(agents), belief.step
        cells = self._guidance.next_cells(agents, present)
        self.drawn = self.drawn or self._guidance.drawn
        return cells

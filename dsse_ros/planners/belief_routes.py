# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Routes planned on the belief, flown for some steps, and planned again."""

from __future__ import annotations

import copy
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from dsse_ros.belief.protocol import TargetBelief, TargetForecast
from dsse_ros.planners.planner import Cell, DecisionPoint
from dsse_ros.planners.routes import RouteFollower
from dsse_ros.scenario.actions import ActionSet
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.swarm import Swarm
from dsse_ros.search.observation import Observation

BeliefRoutePlan: TypeAlias = Callable[
    [TargetBelief, Sequence[Cell], int, Sequence[ActionSet]], Sequence[Sequence[Cell]]
]
"""Maps a belief, the drones' cells, the steps until the next plan and the actions of each drone in
the area to one route per drone: the cells to search in order, with a cell to search twice listed
twice. No route is empty."""


class RoutesOnBelief:
    """A tactic that flies routes and replans them every few steps, or when the live drones change.

    Args:
        plan: Makes the routes.
        forecast: Forecast of the mission.
        period: Steps between two plans.
        seed: Seed for the choice of the cell to step aside to when a route is blocked.

    Attributes:
        drawn: Whether its seed has made a difference so far.
    """

    def __init__(
        self, plan: BeliefRoutePlan, forecast: TargetForecast, period: int, seed: int
    ) -> None:
        self._plan = plan
        self._swarm = Swarm.of(forecast.scenario, forecast.rules)
        self._limit = forecast.scenario.timestep_limit
        self._period = period
        self._seed = seed
        self._follower: RouteFollower | None = None
        self._agents: list[Hashable] = []
        self._planned_at = 0
        self.drawn = False

    def copy(self) -> RoutesOnBelief:
        """Return an independent copy in the same state."""
        twin = copy.copy(self)
        twin._follower = None if self._follower is None else self._follower.copy()
        return twin

    def with_seed(self, seed: int) -> RoutesOnBelief:
        """Return a copy that draws with this seed."""
        twin = copy.copy(self)
        twin._seed = seed
        if self._follower is not None:
            twin._follower = self._follower.with_seed(seed + self._planned_at)
        return twin

    def __call__(self, at: DecisionPoint) -> list[Cell]:
        """Return the cell that each drone goes to; see `Tactic`."""
        belief, agents, present, *_ = at
        due = belief.step >= self._planned_at + self._period or list(agents) != self._agents
        if self._follower is None or due:
            steps = max(1, min(self._period, self._limit - belief.step))
            routes = self._plan(belief, present, steps, self._swarm.actions_of(agents))
            self._follower = RouteFollower(
                lambda cells, probability, actions: routes,
                # The one who flies the tactic keeps slower drones apart.
                replace(self._swarm, has_slower=False),
                seed=self._seed + belief.step,
            )
            self._agents, self._planned_at = list(agents), belief.step
        size = belief.forecast.scenario.grid_size
        unused = np.zeros((size, size), np.float32)
        observations = {
            str(agent): Observation(np.array(cell), unused)
            for agent, cell in zip(agents, present, strict=True)
        }
        chosen = self._follower(observations, {}).values()
        self.drawn = self.drawn or self._follower.drawn
        return self._swarm.actions.ends(present, chosen)


class RoutePlanning:
    """Makes the tactic `RoutesOnBelief` for each mission.

    Args:
        plan: Makes the routes.
        period: Steps between two plans.
    """

    drift_samples = 16

    def __init__(self, plan: BeliefRoutePlan, period: int) -> None:
        self._plan = plan
        self._period = period

    def horizon(self, rules: Rules) -> int:
        """Return 0: plans are made on the belief of the present."""
        return 0

    def start(self, forecast: TargetForecast, seed: int) -> RoutesOnBelief:
        """Return the tactic for a mission."""
        return RoutesOnBelief(self._plan, forecast, self._period, seed)

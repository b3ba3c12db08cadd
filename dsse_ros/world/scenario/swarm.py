# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The actions of each drone of a search, by its kind."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsse_ros.world.scenario.action_times import any_binding
from dsse_ros.world.scenario.actions import ActionSet, Cell
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import Scenario


def number_of(agent: Hashable) -> int:
    """Return the number of an agent, `drone3` or 3."""
    return int(str(agent).removeprefix("drone"))


@dataclass(frozen=True)
class Swarm:
    """What the drones of a search can do, and where they can fly.

    Attributes:
        actions: Actions of the rules in the area.
        of_kinds: Actions of each kind of drone.
        kinds: (N,) kind of each drone; may be empty if there is one kind.
        may_be_under_way: Whether drones may be slow to leave their cells, see `masking.keep_apart`.
    """

    actions: ActionSet
    of_kinds: tuple[ActionSet, ...]
    kinds: tuple[int, ...] = ()
    may_be_under_way: bool = False

    @classmethod
    def alike(cls, names: Iterable[str], area: NDArray[np.bool_] | None = None) -> Swarm:
        """Return a swarm whose drones can do all actions.

        Args:
            names: Names of the actions by number.
            area: (R, C) bool [row, col], the cells to search; None for the whole grid.

        Raises:
            ValueError: If search is missing.
        """
        actions = ActionSet(names, area)
        return cls(actions, (actions,))

    @classmethod
    def of_scenario(cls, scenario: Scenario, rules: Rules) -> Swarm:
        """Return the swarm of a scenario."""
        resolved = scenario.resolve(rules)
        actions = rules.action_set.within(resolved.area_mask)
        of_kinds = tuple(actions.of_kind(kind, resolved.grid_size) for kind in resolved.kinds)
        return cls(actions, of_kinds, resolved.kind_of, any_binding(resolved, rules))

    def with_moves(self) -> Swarm:
        """Return this swarm after checking that the rules have moves to every cell of a grid.

        Raises:
            ValueError: If one of the four straight moves is missing.
        """
        self.actions.with_moves()
        return self

    def kind_of(self, agent: Hashable) -> int:
        """Return the number of an agent's kind, an index of `of_kinds`."""
        return self.kinds[number_of(agent)] if len(self.of_kinds) > 1 else 0

    def actions_of(self, agents: Collection[Hashable]) -> list[ActionSet]:
        """Return the actions that each of these agents can do."""
        if len(self.of_kinds) == 1:
            return [*self.of_kinds] * len(agents)
        return [self.of_kinds[self.kind_of(agent)] for agent in agents]

    def moves_to(self, drone: int, start: Cell, goal: Cell) -> int:
        """Return the number of moves of a drone to a cell that it can reach.

        A cell off the grid, where some rules let drones fly, counts as the nearest one on it.
        """
        (actions,) = self.actions_of([drone])
        if actions.area is not None:
            last = len(actions.area) - 1
            start = min(max(start[0], 0), last), min(max(start[1], 0), last)
        return max(actions.distance(start, goal), 0)

    def reaches(self, drone: int, start: Cell, goal: Cell) -> bool:
        """Return whether a drone's moves in the area lead from one cell to another."""
        (actions,), (col, row) = self.actions_of([drone]), goal
        reachable = actions.reachable(start)
        return reachable is None or bool(reachable[row, col])

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Coverage by shortest ways: each drone flies to a cell of its own that is left to cover.

A* (Hart, Nilsson and Raphael, 1968) from cell to cell, around what is not to be searched and the
other drones. Of all shortest ways it takes the one with most probability on it, as a drone covers
what it flies over.
"""

from __future__ import annotations

import copy
import heapq
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.heeding import heed_masks
from dsse_ros.planners.planner import AgentObservation, Cell, Search, cells_of, probability_of
from dsse_ros.scenario.actions import ActionSet

CLOSENESS = 0.3
"""A cell one move farther away counts for this part."""
LONELINESS = 3.0
"""A cell with nothing left around it counts for this much more: to come back for it takes long."""


def make_astar(search: Search, *, seed: int = 0) -> AStar:
    """Return a planner for a coverage task; it draws nothing."""
    area = search.scenario.resolve(search.rules).area_mask
    actions = search.rules.action_set.within(area).with_moves()
    return AStar(actions, apart=search.scenario.has_slower_drones)


class AStar:
    """Sends each drone to the best cell that is left: near, probable, lonely, and nobody's goal.

    Of all drones without a goal and cells that are nobody's, the pair goes together for which the
    root of the probability, times `CLOSENESS` to the power of the distance, times up to
    1 + `LONELINESS`, is greatest. A goal stays until it is covered. A drone whose way is blocked,
    or for which no cell is left, stays where it is.

    Args:
        actions: The actions, in the area.
        apart: Whether drones may be slow to leave their cells, see `heeding.keep_apart`.

    Attributes:
        drawn: See `SharedPlanner`.
    """

    drawn = False

    def __init__(self, actions: ActionSet, *, apart: bool = False) -> None:
        self._actions = actions
        self._apart = apart
        self._goals: dict[str, Cell] = {}

    def copy(self) -> AStar:
        """Return one that goes on by itself from here."""
        return copy.copy(self)

    def with_seed(self, seed: int) -> AStar:
        """Return a copy."""
        return self.copy()

    def __call__(
        self,
        observations: Mapping[str, AgentObservation],
        infos: Mapping[str, Mapping[str, Any]],
    ) -> dict[str, int]:
        """Return an action number for every observed drone; see `Planner`."""
        if not observations:
            return {}
        left, present = probability_of(observations), cells_of(observations)
        self._choose_goals(dict(zip(observations, present, strict=True)), left)
        taken, actions = set(present), {}
        for agent, cell in zip(observations, present, strict=True):
            taken.discard(cell)
            goal = self._goals.get(agent, cell)
            end = next_cell(self._actions, left, cell, goal, taken)
            taken.add(end)
            actions[agent] = self._actions.action(cell, end)
        if not self._apart:
            return actions
        cells = dict(zip(observations, present, strict=True))
        return heed_masks(actions, cells, infos, self._actions, apart=True)

    def _choose_goals(self, present: Mapping[str, Cell], left: NDArray[np.float32]) -> None:
        """Give each drone a goal, as far as there are cells."""
        self._goals = {
            agent: (col, row)
            for agent, (col, row) in self._goals.items()
            if agent in present and left[row, col] > 0
        }
        free = np.sqrt(left, dtype=np.float64) * (1.0 + LONELINESS * _share_covered_around(left))
        for col, row in self._goals.values():
            free[row, col] = 0.0
        waiting = [agent for agent in present if agent not in self._goals]
        worth = {agent: free * self._closeness(present[agent], len(left)) for agent in waiting}
        while worth:
            agent = max(worth, key=lambda one: float(worth[one].max()))
            row, col = divmod(int(worth[agent].argmax()), len(left))
            if worth.pop(agent)[row, col] <= 0:
                return
            self._goals[agent] = (col, row)
            for others in worth.values():
                others[row, col] = 0.0

    def _closeness(self, cell: Cell, size: int) -> NDArray[np.float64]:
        """Return what the distance of each cell (G, G) leaves of its worth, 0 without a way."""
        away = self._actions.distances(cell, size)
        closeness: NDArray[np.float64] = np.where(away < 0, 0.0, CLOSENESS**away)
        return closeness


def _share_covered_around(left: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return of each cell (G, G) the share of the eight around it where nothing is left."""
    size, around = len(left), np.pad(left > 0, 1).astype(np.float64)
    cells = sum(around[dy : dy + size, dx : dx + size] for dy in range(3) for dx in range(3))
    share: NDArray[np.float64] = 1.0 - (cells - (left > 0)) / 8.0
    return share


def next_cell(
    actions: ActionSet,
    left: NDArray[np.float32],
    start: Cell,
    goal: Cell,
    taken: Collection[Cell],
) -> Cell:
    """Return the first cell of the best way; the start, if there is none.

    Args:
        actions: Which moves there are.
        left: (G, G), the probability that is left.
        start: Where it begins.
        goal: Where it leads to.
        taken: Cells that the first move cannot go to.
    """
    size = len(left)
    # Layer by layer of equal length: a cell is reached by its most probable way first.
    queue = [(actions.distance(start, goal), 0, 0.0, start, start)]
    done = set()
    while queue:
        _, steps, gain, cell, first = heapq.heappop(queue)
        if cell == goal:
            return first
        if cell in done:
            continue
        done.add(cell)
        for ahead in actions.neighbours(cell, size):
            rest = actions.distance(ahead, goal)
            if ahead in done or rest < 0 or (steps == 0 and ahead in taken):
                continue
            found = gain - float(left[ahead[1], ahead[0]])
            by = first if steps else ahead
            heapq.heappush(queue, (steps + 1 + rest, steps + 1, found, ahead, by))
    return start

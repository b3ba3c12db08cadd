# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Coverage by shortest paths: each drone flies to a cell of its own that is left to cover.

A* (Hart, Nilsson and Raphael, 1968) plans from cell to cell, around cells outside the search area
and around other drones. A drone covers the cells that it flies over, so among the shortest paths
the planner takes the one with the most probability.
"""

from __future__ import annotations

import copy
import heapq
from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.masking import masked_moves
from dsse_ros.planners.mission_watch import MissionWatch
from dsse_ros.planners.options import Options
from dsse_ros.planners.planner import (
    Cell,
    DrawsNothing,
    Infos,
    Observations,
    Search,
    cells_of,
    probability_of,
)
from dsse_ros.world.scenario.actions import ActionSet
from dsse_ros.world.scenario.swarm import Swarm

CLOSENESS = 0.3
"""Factor on the worth of a cell for each move to it."""
LONELINESS = 3.0
"""How much more a cell with nothing left around it counts: coming back for it later takes long."""


def make_astar(search: Search, options: Options, *, seed: int) -> AStar:
    """Return a planner for a coverage task; the seed makes no difference."""
    swarm = Swarm.of_scenario(search.scenario, search.rules).with_moves()
    return AStar(swarm, MissionWatch(search))


class AStar(DrawsNothing):
    """Sends each drone to the best remaining cell: near, probable, isolated, and nobody's goal.

    Among the drones without a goal and the cells that are nobody's goal, the planner matches the
    pair with the greatest worth: the root of the probability, times `CLOSENESS` to the power of
    the distance, times up to 1 + `LONELINESS`. A drone keeps its goal until the cell is covered.
    A drone whose path is blocked, or for which no cell is left, stays where it is.

    Args:
        swarm: What the drones can do.
        watch: Recognizes a mission's first observation.
    """

    def __init__(self, swarm: Swarm, watch: MissionWatch) -> None:
        self._swarm, self._watch = swarm, watch
        self._goals: dict[str, Cell] = {}

    def copy(self) -> AStar:
        """Return an independent copy in the same state."""
        twin = copy.copy(self)
        twin._watch = self._watch.copy()
        return twin

    def __call__(self, observations: Observations, infos: Infos) -> dict[str, int]:
        """Return an action number for every observed drone; see `Planner`."""
        if not observations:
            return {}
        if self._watch.is_new(observations, infos):
            self._goals = {}
        left, present = probability_of(observations), cells_of(observations)
        cells = dict(zip(observations, present, strict=True))
        actions = dict(zip(cells, self._swarm.actions_of(cells), strict=True))
        self._choose_goals(actions, cells, left)
        taken, ends = set(present), []
        for agent, cell in cells.items():
            taken.discard(cell)
            goal = self._goals.get(agent, cell)
            end = next_cell(actions[agent], left, cell, goal, taken)
            taken.add(end)
            ends.append(end)
        return masked_moves(cells, ends, infos, self._swarm)

    def _choose_goals(
        self,
        actions: Mapping[str, ActionSet],
        present: Mapping[str, Cell],
        left: NDArray[np.float32],
    ) -> None:
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
        worth = {
            agent: free * _closeness(actions[agent], present[agent], GridShape.of(left))
            for agent in waiting
        }
        while worth:
            agent = max(worth, key=lambda candidate: float(worth[candidate].max()))
            row, col = divmod(int(worth[agent].argmax()), left.shape[1])
            if worth.pop(agent)[row, col] <= 0:
                return
            self._goals[agent] = (col, row)
            for others in worth.values():
                others[row, col] = 0.0


def _closeness(actions: ActionSet, cell: Cell, grid: GridShape) -> NDArray[np.float64]:
    """Return the factor for the distance to each cell (R, C), 0 for unreachable cells."""
    away = actions.distances(cell, grid)
    closeness: NDArray[np.float64] = np.where(away < 0, 0.0, CLOSENESS**away)
    return closeness


def _share_covered_around(left: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return, for each cell (R, C), the share of its eight neighbours where nothing is left."""
    (rows, cols), around = left.shape, np.pad(left > 0, 1).astype(np.float64)
    cells = sum(around[dy : dy + rows, dx : dx + cols] for dy in range(3) for dx in range(3))
    share: NDArray[np.float64] = 1.0 - (cells - (left > 0)) / 8.0
    return share


def next_cell(
    actions: ActionSet,
    left: NDArray[np.float32],
    start: Cell,
    goal: Cell,
    taken: Collection[Cell],
) -> Cell:
    """Return the first cell of the best path; the start, if there is none.

    Args:
        actions: The available moves.
        left: (R, C), the probability that is left.
        start: Start of the path.
        goal: Goal of the path.
        taken: Cells that the first move may not enter.
    """
    grid = GridShape.of(left)
    # Paths of equal length are ordered by probability, so the most probable one comes first.
    queue = [(actions.distance(start, goal), 0, 0.0, start, start)]
    done = set()
    while queue:
        _, steps, gain, cell, first = heapq.heappop(queue)
        if cell == goal:
            return first
        if cell in done:
            continue
        done.add(cell)
        for ahead in actions.neighbours(cell, grid):
            rest = actions.distance(ahead, goal)
            if ahead in done or rest < 0 or (steps == 0 and ahead in taken):
                continue
            found = gain - float(left[ahead[1], ahead[0]])
            by = first if steps else ahead
            heapq.heappush(queue, (steps + 1 + rest, steps + 1, found, ahead, by))
    return start

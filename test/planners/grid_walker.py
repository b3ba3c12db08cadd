# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The movement rules alone: drones on a grid that move at once and must not meet."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.planner import Planner
from dsse_ros.search.environments.agents import Observation
from dsse_ros.world.scenario.actions import ACTION_VECTORS

STRAIGHT = ("left", "right", "up", "down", "search")
DIAGONAL = (
    *("left", "right", "up", "down"),
    *("up_left", "up_right", "down_left", "down_right"),
    "search",
)


def default_start(size: int, count: int) -> list[tuple[int, int]]:
    """Return the cells (col, row) of the default start, row by row from (0, 0)."""
    return [(drone % size, drone // size) for drone in range(count)]


class GridWalker:
    """Walks drones over a grid and fails on any move that the rules punish.

    Args:
        size: Cells along a side.
        starts: First cell (col, row) of each drone.
        actions: Names of the actions by number.
        probability: Map (G, G), the same for the whole walk.
    """

    def __init__(
        self,
        size: int,
        starts: Sequence[tuple[int, int]],
        actions: Sequence[str] = STRAIGHT,
        probability: NDArray[np.float32] | None = None,
    ) -> None:
        self.size = size
        self.actions = actions
        self.cells = {f"drone{i}": cell for i, cell in enumerate(starts)}
        self.searched: Counter[tuple[int, int]] = Counter()
        self.steps = 0
        if probability is None:
            probability = np.full((size, size), 1 / size**2, np.float32)
        self.probability = probability

    @property
    def covered(self) -> bool:
        """Whether every cell was searched."""
        return len(self.searched) == self.size**2

    def lose(self, agents: Iterable[str]) -> None:
        """Take drones out of the mission; their cells are free from now on."""
        for agent in agents:
            del self.cells[agent]

    def leaves(self, cell: tuple[int, int]) -> bool:
        """Whether a cell is outside the grid."""
        return not (0 <= cell[0] < self.size and 0 <= cell[1] < self.size)

    def target(self, agent: str, action: int) -> tuple[int, int]:
        """Return the cell that an action leads to."""
        (col, row), (d_col, d_row) = self.cells[agent], ACTION_VECTORS[self.actions[action]]
        return col + d_col, row + d_row

    def mask(self, agent: str) -> NDArray[np.int8]:
        """Return the action mask (A,)."""
        numbers = range(len(self.actions))
        return np.array([not self.leaves(self.target(agent, k)) for k in numbers], np.int8)

    def step(self, planner: Planner) -> dict[str, int]:
        """Do one step as the planner says; return its actions."""
        observations = {
            agent: Observation(np.array(cell, np.int64), self.probability)
            for agent, cell in self.cells.items()
        }
        infos = {agent: {"Found": False, "action_mask": self.mask(agent)} for agent in self.cells}
        actions = planner(observations, infos)
        assert list(actions) == list(self.cells)
        assert all(type(action) is int for action in actions.values())
        ends = {agent: self.target(agent, action) for agent, action in actions.items()}
        assert not any(self.leaves(cell) for cell in ends.values()), (self.cells, ends)
        assert len(set(ends.values())) == len(ends), (self.cells, ends)
        self.searched.update(c for a, c in self.cells.items() if ends[a] == c)
        self.cells = ends
        self.steps += 1
        return actions

    def cover(self, planner: Planner, limit: int) -> None:
        """Step until every cell was searched; fail after the limit of steps."""
        while not self.covered:
            assert self.steps < limit, f"{self.size**2 - len(self.searched)} cells left"
            self.step(planner)

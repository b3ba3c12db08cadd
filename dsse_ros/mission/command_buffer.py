# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The commands of the drones for the next step, without ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.actions import Cell
from dsse_ros.scenario.swarm import Swarm
from dsse_ros.search import HOLD

MISSING_ACTIONS = ("search", "repeat", "hold", "abort")
"""Choices for drones without a command when the step cannot wait."""


@dataclass(frozen=True, eq=False)
class Goal:
    """The cell (col, row) of one command; the same cell of another command is another goal."""

    cell: Cell


class CommandBuffer:
    """The last command of each drone: one action for the next step, or a goal.

    Args:
        swarm: What the drones can do.
        num_drones: N.

    Raises:
        ValueError: If a straight move is missing.
    """

    def __init__(self, swarm: Swarm, num_drones: int) -> None:
        self._swarm = swarm.with_moves()
        self._num_drones = num_drones
        self.clear()

    def clear(self) -> None:
        """Drop all commands, goals and previous actions."""
        self._actions: dict[int, int] = {}
        self._goals: dict[int, Goal] = {}
        self._last: dict[int, int] = {}

    def state(self) -> dict[str, Any]:
        """Return the state that outlasts a step, as JSON values: goals and previous actions."""
        goals = [(drone, goal.cell) for drone, goal in self._goals.items()]
        return {"goals": goals, "last": list(self._last.items())}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over the state of another buffer; actions for the next step are cleared."""
        self.clear()
        self._goals = {drone: Goal((col, row)) for drone, (col, row) in state["goals"]}
        self._last = dict(state["last"])

    def set_action(self, drone: int, action: int) -> None:
        """Set the drone's action for the next step; this replaces any other command."""
        self._goals.pop(drone, None)
        self._actions[drone] = action

    def set_goal(self, drone: int, cell: Cell) -> None:
        """Send the drone to this cell; this replaces any other command."""
        self._actions.pop(drone, None)
        self._goals[drone] = Goal(cell)

    def goal_of(self, drone: int) -> Goal | None:
        """Return the goal of a drone, None if its command is another or none."""
        return self._goals.get(drone)

    def drop_goal(self, drone: int) -> None:
        """Take the goal of a drone back: it has no command."""
        self._goals.pop(drone, None)

    def moves_to(self, drone: int, start: Cell, goal: Cell) -> int:
        """Return the number of moves of a drone to a goal that it can reach.

        A cell off the grid, where some rules let drones fly, counts as the nearest one on it.
        """
        (actions,) = self._swarm.actions_of([drone])
        if actions.area is not None:
            last = len(actions.area) - 1
            start = min(max(start[0], 0), last), min(max(start[1], 0), last)
        return max(actions.distance(start, goal), 0)

    def reaches(self, drone: int, start: Cell, goal: Cell) -> bool:
        """Return whether a drone's moves in the area lead from one cell to another."""
        (actions,), (col, row) = self._swarm.actions_of([drone]), goal
        reachable = actions.reachable(start)
        return reachable is None or bool(reachable[row, col])

    def missing(self, live: Sequence[int], cells: NDArray[np.int64]) -> list[int]:
        """Return the live drones without a command; cells (N, 2) are those of the drones."""
        return [i for i in live if i not in self._actions and not self._ahead(i, cells)]

    def take(
        self, live: Sequence[int], cells: NDArray[np.int64], missing_action: str
    ) -> NDArray[np.int8]:
        """Return the joint action (N,) and clear the commands for one step.

        Args:
            live: Drones still in flight; the others hold.
            cells: (N, 2) cells of the drones.
            missing_action: Action of a drone without a command: search, repeat or hold.
        """
        joint = np.full(self._num_drones, HOLD, np.int8)
        for i in live:
            if i in self._actions:
                joint[i] = self._actions[i]
            elif goal := self._ahead(i, cells):
                here = (int(cells[i, 0]), int(cells[i, 1]))
                (actions,) = self._swarm.actions_of([i])
                joint[i] = actions.action(here, actions.towards(here, goal))
            elif missing_action == "search":
                joint[i] = self._swarm.actions.search
            elif missing_action == "repeat":
                joint[i] = self._last.get(i, HOLD)
            self._last[i] = int(joint[i])
        self._actions.clear()
        return joint

    def _ahead(self, drone: int, cells: NDArray[np.int64]) -> Cell | None:
        """Return the cell of the drone's goal; drop the goal if the drone has reached it."""
        goal = self._goals.get(drone)
        if goal is None:
            return None
        if goal.cell == (cells[drone, 0], cells[drone, 1]):
            self.drop_goal(drone)
            return None
        return goal.cell

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The commands of the drones for the next step, without ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.actions import Cell
from dsse_ros.scenario.swarm import Swarm
from dsse_ros.search import HOLD

MISSING_ACTIONS = ("search", "repeat", "hold", "abort")
"""Choices for drones without a command when the step cannot wait."""


class CommandBuffer:
    """The last command of each drone: one action for the next step, or goal cells.

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
        self._goals: dict[int, list[Cell]] = {}
        self._last: dict[int, int] = {}

    def state(self) -> dict[str, Any]:
        """Return the state that outlasts a step, as JSON values: goals and previous actions."""
        return {"goals": list(self._goals.items()), "last": list(self._last.items())}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over the state of another buffer; actions for the next step are cleared."""
        self.clear()
        self._goals = {drone: [(c, r) for c, r in goals] for drone, goals in state["goals"]}
        self._last = dict(state["last"])

    def set_action(self, drone: int, action: int) -> None:
        """Set the drone's action for the next step; this replaces any other command."""
        self._goals.pop(drone, None)
        self._actions[drone] = action

    def set_goals(self, drone: int, goals: Sequence[Cell]) -> None:
        """Send the drone to these cells in order; this replaces any other command."""
        self._actions.pop(drone, None)
        self._goals[drone] = list(goals)

    def goals_of(self, drone: int) -> list[Cell] | None:
        """Return the goals of a drone that are ahead, None if its command is another or none.

        It is the same list until another command replaces the goals.
        """
        return self._goals.get(drone)

    def drop_goals(self, drone: int) -> None:
        """Take the goals of a drone back: it has no command."""
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

    def out_of_reach(self, drone: int, start: Cell, goals: Sequence[Cell]) -> list[Cell]:
        """Return the goals that a drone's moves in the area cannot reach, one after the other."""
        (actions,), unreached = self._swarm.actions_of([drone]), []
        reachable = actions.reachable(start)
        for col, row in goals if reachable is not None else ():
            if reachable is not None and not reachable[row, col]:
                unreached.append((col, row))
            elif not actions.two_way:
                reachable = actions.reachable((col, row))
        return unreached

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
        """Return the drone's next goal; drop goals that it has reached."""
        goals = self._goals.get(drone)
        while goals and goals[0] == (cells[drone, 0], cells[drone, 1]):
            goals.pop(0)
        return goals[0] if goals else None

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The commands of the drones for the next step, on cells or in metres, without ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.run.mission_space import Goal, MissionSpace
from dsse_ros.world.scenario.actions import Cell

MISSING_ACTIONS = ("search", "repeat", "hold", "abort")
"""Choices for drones without a command when the step cannot wait."""


class CommandBuffer:
    """The last command of each drone: one action for the next step, or a goal.

    Args:
        space: What the actions and the goals of the drones are.
    """

    def __init__(self, space: MissionSpace[Any]) -> None:
        self._space = space
        self.clear()

    def clear(self) -> None:
        """Drop all commands, goals and previous actions."""
        self._actions: dict[int, Any] = {}
        self._goals: dict[int, Goal[Any]] = {}
        self._last: dict[int, Any] = {}

    def state(self) -> dict[str, Any]:
        """Return the state that outlasts a step, as JSON values: goals and previous actions."""
        goals = [
            (drone, self._space.state(goal)) for drone, goal in self._goals.items() if not goal.over
        ]
        return {self._space.goals: goals, "last": list(self._last.items())}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over the state of another buffer; actions for the next step are cleared."""
        self.clear()
        self._goals = {
            drone: self._space.restored(goal) for drone, goal in state[self._space.goals]
        }
        self._last = dict(state["last"])

    def set_action(self, drone: int, action: Any) -> None:
        """Set the drone's action for the next step; this replaces any other command."""
        self._goals.pop(drone, None)
        self._actions[drone] = action

    def set_goal(self, drone: int, where: Any) -> None:
        """Send the drone to a cell or along points (M, 2), see `MissionSpace.goal`.

        This replaces any other command.
        """
        self._actions.pop(drone, None)
        self._goals[drone] = self._space.goal(drone, where)

    def goal_of(self, drone: int) -> Goal[Any] | None:
        """Return the goal that a drone is on the way to, None if its command is another or none."""
        goal = self._goals.get(drone)
        return None if goal is None or goal.over else goal

    def last_goal_of(self, drone: int) -> Goal[Any] | None:
        """Return the last goal of a drone, over or not, None if another command replaced it."""
        return self._goals.get(drone)

    def drop_goal(self, drone: int) -> None:
        """Take the goal of a drone back: it has no command."""
        self._goals.pop(drone, None)

    def after_step(self) -> None:
        """Take what the drones flew in a step into account for their goals."""
        for drone, goal in self._goals.items():
            if not goal.over:
                self._space.after_step(drone, goal)

    def missing(self, live: Sequence[int], cells: NDArray[np.int64]) -> list[int]:
        """Return the live drones without a command; cells (N, 2) are those of the drones."""
        return [i for i in live if i not in self._actions and not self._ahead(i, cells)]

    def take(
        self, live: Sequence[int], cells: NDArray[np.int64], missing_action: str
    ) -> NDArray[Any]:
        """Return the joint command (N, ...) and clear the commands for one step.

        Args:
            live: Drones still in flight; the others do nothing.
            cells: (N, 2) cells of the drones.
            missing_action: What a drone without a command does: `repeat` its last action, or see
                `MissionSpace.without`.
        """
        joint = self._space.joint()
        for i in live:
            if i in self._actions:
                joint[i] = self._actions[i]
            elif goal := self._ahead(i, cells):
                joint[i] = self._space.toward(i, goal, _cell(cells, i))
            elif missing_action != "repeat":
                joint[i] = self._space.without(i, missing_action)
            elif i in self._last:
                joint[i] = self._last[i]
            self._last[i] = joint[i].tolist()
        self._actions.clear()
        return joint

    def _ahead(self, drone: int, cells: NDArray[np.int64]) -> Goal[Any] | None:
        """Return the goal of a drone that is not there yet."""
        if goal := self.goal_of(drone):
            goal.over = self._space.is_there(goal, _cell(cells, drone))
        return self.goal_of(drone)


def _cell(cells: NDArray[np.int64], drone: int) -> Cell:
    col, row = cells[drone].tolist()
    return col, row

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Goals that somebody waits for: how far their drones are from them, and how each ends.

A goal is itself a command of the mission, like one of `command_pose`.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from enum import Enum
from typing import Any, Generic, TypeVar

from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.mission_space import Goal
from dsse_ros.world.scenario.actions import Cell

T = TypeVar("T")


class Ending(Enum):
    """How a goal has ended."""

    REACHED = "the drone is there, and so is its vehicle if steps wait for vehicles"
    CANCELED = "its sender has canceled it"
    ABORTED = "the drone will not get there"


@dataclass(frozen=True)
class Ended(Generic[T]):
    """The end of a goal.

    Attributes:
        handle: As given to `Navigation.begin`.
        reason: Why it was aborted, on one line; empty otherwise.
    """

    drone: int
    handle: T
    ending: Ending
    reason: str = ""


@dataclass(frozen=True)
class GoalProgress(Generic[T]):
    """How far a goal is.

    Attributes:
        handle: As given to `Navigation.begin`.
        left_m: Length of the way left.
        left_s: Mission time that it takes.
        elapsed_ns: Mission time since the goal was accepted.
    """

    drone: int
    handle: T
    left_m: float
    left_s: float
    elapsed_ns: int


@dataclass(frozen=True)
class _Goal(Generic[T]):
    """A goal that somebody waits for, and the command that it is."""

    handle: T
    command: Goal[Any]
    mission: int
    begun_ns: int


class Navigation(Generic[T]):
    """The goals that have not ended, at most one for each drone.

    Args:
        mission: The mission, whose command buffer has the goals.
    """

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._goals: dict[int, _Goal[T]] = {}

    @property
    def active(self) -> bool:
        """Whether there are goals."""
        return bool(self._goals)

    def begin(self, drone: int, handle: T) -> list[Ended[T]]:
        """Follow the goal that was just set as the command of a drone; it replaces another.

        Returns:
            The end of the goal that it replaces, and its own if it is not the command any more.
        """
        ended, old = [], self._goals.pop(drone, None)
        if old is not None:
            replaced = Ended(drone, old.handle, Ending.ABORTED, self._replaced(drone))
            ended.append(self._end_of(drone, old, {drone}) or replaced)
        command = self._mission.commands.last_goal_of(drone)
        if command is None:
            return [*ended, Ended(drone, handle, Ending.ABORTED, self._replaced(drone))]
        self._goals[drone] = _Goal(
            handle, command, self._mission.number, self._mission.result.stamp_ns
        )
        return ended

    def cancel(self, handle: T) -> list[Ended[T]]:
        """Take back a goal: its drone has no command then. Returns its end, if it had none."""
        for drone, goal in self._goals.items():
            if goal.handle == handle:
                if self._is_command(drone, goal):
                    self._mission.commands.drop_goal(drone)
                del self._goals[drone]
                return [Ended(drone, handle, Ending.CANCELED)]
        return []

    def check(self, late: Collection[int]) -> list[Ended[T]]:
        """Return the goals that have ended since the last call, and forget them.

        Args:
            late: The drones whose vehicles have to arrive in their cells first.
        """
        ended = []
        for drone, goal in list(self._goals.items()):
            end = self._end_of(drone, goal, late)
            if end is not None:
                del self._goals[drone]
                ended.append(end)
        return ended

    def progress(self) -> list[GoalProgress[T]]:
        """Return how far the goals are."""
        now_ns = self._mission.result.stamp_ns
        return [
            GoalProgress(
                drone,
                goal.handle,
                *self._mission.space.way_left(drone, goal.command, self._cell(drone)),
                max(now_ns - goal.begun_ns, 0),
            )
            for drone, goal in self._goals.items()
        ]

    def _end_of(self, drone: int, goal: _Goal[T], late: Collection[int]) -> Ended[T] | None:
        mission, name = self._mission, self._mission.env.possible_agents[drone]
        cell, is_command = self._cell(drone), self._is_command(drone, goal)
        reason = ""
        if mission.number != goal.mission:
            reason = f"mission {goal.mission} was reset"
        elif drone in mission.lost or drone in mission.fallen:
            reason = f"{name} is lost"
        elif not (mission.done or drone in mission.live):
            reason = f"{name} is out of the search"
        elif mission.space.is_there(goal.command, cell, is_command=is_command):
            # Until its vehicle has arrived too, the next command does not end it.
            return None if drone in late else Ended(drone, goal.handle, Ending.REACHED)
        elif mission.done:
            reason = f"mission {mission.number} is over: {mission.outcome}"
        elif goal.command.over or not is_command:
            reason = self._replaced(drone)
        return Ended(drone, goal.handle, Ending.ABORTED, reason) if reason else None

    def _replaced(self, drone: int) -> str:
        return f"another command of {self._mission.env.possible_agents[drone]} has replaced it"

    def _is_command(self, drone: int, goal: _Goal[T]) -> bool:
        return self._mission.commands.last_goal_of(drone) is goal.command

    def _cell(self, drone: int) -> Cell:
        col, row = self._mission.result.cells[drone].tolist()
        return col, row

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Cells or metres: what actions and goals are where drones move from cell to cell, or fly.

A `Mission` and its `CommandBuffer` share a `MissionSpace`. What drones in metres have besides, such
as a wind and paths, is in `World.metres`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.result import Rejected
from dsse_ros.mission.vehicles.track_follower import TrackLeft, has_arrived, steer, way_left
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.environments.space import STRAIGHT_ON
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.actions import Cell
from dsse_ros.world.scenario.swarm import Swarm

Where = TypeVar("Where")


@dataclass(eq=False)
class Goal(Generic[Where]):
    """Where one command sends a drone; the same place of another command is another goal.

    Attributes:
        where: The cell (col, row), or what is left of a track in metres.
        over: Whether the drone has been there: the goal is no command any more.
    """

    where: Where
    over: bool = False


class MissionSpace(ABC, Generic[Where]):
    """Cells or metres, for the N drones of a mission.

    Attributes:
        goals: Name of the goals in a snapshot.
        speeds_mps: The airspeed of cruise of each drone in metres, m/s; none on cells.
    """

    goals: str
    speeds_mps: tuple[float, ...] = ()

    # Actions

    @abstractmethod
    def joint(self) -> NDArray[Any]:
        """Return the actions (N, ...) of drones without a command or a previous action."""

    @abstractmethod
    def without(self, drone: int, missing_action: str) -> Any:
        """Return the action of a drone without a command, by `search` or `hold`."""

    @abstractmethod
    def apply(self, joint: NDArray[Any], live: Sequence[int]) -> NDArray[np.int8]:
        """Give the world the actions (N, ...) of the next step; return them by number (N,)."""

    @abstractmethod
    def held(self, numbers: NDArray[np.int8], missing: Sequence[int]) -> NDArray[np.bool_]:
        """Return which live drones (N,) are held in a step.

        Args:
            numbers: (N,) their actions by number.
            missing: The drones that hold because they have no command.
        """

    @abstractmethod
    def ways(self, actions: NDArray[Any] | None, live: Sequence[int]) -> NDArray[np.float64]:
        """Return where actions of live drones lead, see `Mission.ways`."""

    # Goals; a cell is that in which the drone is, (col, row)

    @abstractmethod
    def goal(self, drone: int, where: Any) -> Goal[Where]:
        """Return a new goal of a drone: a cell (col, row) or the points (M, 2) of a track."""

    @abstractmethod
    def refuse_goal(self, drone: int, where: Any) -> Rejected | None:
        """Return why a drone cannot go to a cell or along a track; None if it can."""

    @abstractmethod
    def toward(self, drone: int, goal: Goal[Where], cell: Cell) -> Any:
        """Return the action of a drone on the way to a goal."""

    @abstractmethod
    def after_step(self, drone: int, goal: Goal[Where]) -> None:
        """Take what a drone flew in a step off the way to a goal."""

    @abstractmethod
    def is_there(self, goal: Goal[Where], cell: Cell, *, is_command: bool = True) -> bool:
        """Return whether a drone is at a goal, which may no longer be its command."""

    @abstractmethod
    def way_left(self, drone: int, goal: Goal[Where], cell: Cell) -> tuple[float, float]:
        """Return the length of the way to a goal, m, and the mission time that it takes, s."""

    @abstractmethod
    def state(self, goal: Goal[Where]) -> Any:
        """Return a goal as JSON values."""

    @abstractmethod
    def restored(self, state: Any) -> Goal[Where]:
        """Return the goal of a `state`."""


class CellMissionSpace(MissionSpace[Cell]):
    """Actions are numbers, and a goal is a cell. A drone is held in a step if it does nothing.

    Attributes:
        swarm: What the drones can do.

    Raises:
        ValueError: If a straight move is missing.
    """

    goals = "goals"

    def __init__(self, env: SearchEnv) -> None:
        self._env = env
        self.swarm = Swarm.of_scenario(env.scenario, env.rules).with_moves()

    def joint(self) -> NDArray[np.int8]:
        """See `MissionSpace`."""
        return np.full(self._env.world.num_drones, NO_ACTION, np.int8)

    def without(self, drone: int, missing_action: str) -> int:
        """See `MissionSpace`."""
        return self.swarm.actions.search if missing_action == "search" else NO_ACTION

    def apply(self, joint: NDArray[np.int8], live: Sequence[int]) -> NDArray[np.int8]:
        """See `MissionSpace`."""
        return joint

    def held(self, numbers: NDArray[np.int8], missing: Sequence[int]) -> NDArray[np.bool_]:
        """See `MissionSpace`."""
        return numbers == NO_ACTION

    def ways(self, actions: NDArray[np.int8] | None, live: Sequence[int]) -> NDArray[np.float64]:
        """See `MissionSpace`."""
        world, action_set = self._env.world, self._env.rules.action_set
        drones = world.drones[0]
        ends = np.stack([drones["x"], drones["y"]], axis=1)
        for drone, action in enumerate([] if actions is None else actions.tolist()):
            col, row = ends[drone].tolist()
            inside = world.grid_size.holds(col, row)
            if inside and 0 <= action < len(action_set) and world.mask_table[row][col][action]:
                ends[drone] = action_set.end((col, row), action)
        return ends[:, None].astype(np.float64)

    def goal(self, drone: int, where: Cell) -> Goal[Cell]:
        """See `MissionSpace`."""
        return Goal(where)

    def refuse_goal(self, drone: int, where: Cell) -> Rejected | None:
        """See `MissionSpace`."""
        col, row = self._env.positions[drone].tolist()
        if self.swarm.reaches(drone, (col, row), where):
            return None
        reason = f"cell must be reachable by moves in the area, got {list(where)}"
        return Rejected("outside_area", reason)

    def toward(self, drone: int, goal: Goal[Cell], cell: Cell) -> int:
        """See `MissionSpace`."""
        (actions,) = self.swarm.actions_of([drone])
        return actions.action(cell, actions.towards(cell, goal.where))

    def after_step(self, drone: int, goal: Goal[Cell]) -> None:
        """See `MissionSpace`; its cell says how far a drone is."""

    def is_there(self, goal: Goal[Cell], cell: Cell, *, is_command: bool = True) -> bool:
        """See `MissionSpace`."""
        return goal.where == cell

    def way_left(self, drone: int, goal: Goal[Cell], cell: Cell) -> tuple[float, float]:
        """See `MissionSpace`."""
        scenario, moves = self._env.scenario, self.swarm.moves_to(drone, cell, goal.where)
        return moves * scenario.cell_size, moves * scenario.step_duration_s

    def state(self, goal: Goal[Cell]) -> Cell:
        """See `MissionSpace`."""
        return goal.where

    def restored(self, state: Any) -> Goal[Cell]:
        """See `MissionSpace`."""
        col, row = state
        return Goal((col, row))


class MetresMissionSpace(MissionSpace[TrackLeft]):
    """Actions are turns and speeds, see `step.metres_paths`, and a goal is a track.

    Actions by number are `NO_ACTION`, and no cell counts as searched. A drone is held if it has no
    command and `missing_action` is `hold`.

    Attributes:
        airframes: (N,) of `metres_paths.AIRFRAMES`, of each drone.
    """

    goals = "tracks"

    def __init__(self, env: SearchEnv) -> None:
        assert env.world.metres is not None
        self._env, self._drones, self._kinds = env, env.world.metres, env.world.looks.kind
        self.airframes = self._drones.airframes[self._kinds].view(np.recarray)
        self.speeds_mps = tuple(self.airframes.cruise.tolist())

    def joint(self) -> NDArray[np.float64]:
        """See `MissionSpace`; (N, 2)."""
        return np.tile(np.array(STRAIGHT_ON), (len(self._kinds), 1))

    def without(self, drone: int, missing_action: str) -> tuple[float, float]:
        """See `MissionSpace`.

        By `search` it flies straight on at cruise; by `hold` it stops or, if it cannot, circles to
        the right.
        """
        if missing_action != "hold":
            return STRAIGHT_ON
        return (0.0, -1.0) if self.airframes[drone].slowest <= 0.0 else (1.0, -1.0)

    def apply(self, joint: NDArray[np.float64], live: Sequence[int]) -> NDArray[np.int8]:
        """See `MissionSpace`."""
        self._drones.actions[0] = joint
        if self._env.rules.vehicle_timed_actions:
            # A replay cannot tell them from those whose vehicles' paths are known.
            for drone in live:
                self._drones.preset_plan(drone, int(self._kinds[drone]))
        return np.full(len(joint), NO_ACTION, np.int8)

    def held(self, numbers: NDArray[np.int8], missing: Sequence[int]) -> NDArray[np.bool_]:
        """See `MissionSpace`."""
        held = np.zeros(len(numbers), bool)
        held[missing] = True
        return held

    def ways(self, actions: NDArray[np.float64] | None, live: Sequence[int]) -> NDArray[np.float64]:
        """See `MissionSpace`."""
        drones = self._drones
        ways = np.repeat(drones.in_cells()[0][:, None], drones.paths.shape[2], axis=1)
        if actions is not None:
            for drone in live:
                path = drones.plan(drone, actions[drone], int(self._kinds[drone]))
                ways[drone] = path / self._env.scenario.cell_size - 0.5
        return ways

    def goal(self, drone: int, where: NDArray[np.float64]) -> Goal[TrackLeft]:
        """See `MissionSpace`; points are as those of `TrackLeft`, without where the drone is."""
        state = self._drones.states[0, drone]
        here = np.array([[state["east"], state["south"]]])
        track = TrackLeft(np.vstack([here, where]))
        return Goal(track, self._has_arrived(drone, track, np.vstack([here, here])))

    def refuse_goal(self, drone: int, where: NDArray[np.float64]) -> None:
        """See `MissionSpace`; drones fly everywhere on the grid."""

    def toward(self, drone: int, goal: Goal[TrackLeft], cell: Cell) -> tuple[float, float]:
        """See `MissionSpace`."""
        state, wind = self._drones.states[0, drone], self._drones.wind
        return steer(goal.where, state, self.airframes[drone], wind)

    def after_step(self, drone: int, goal: Goal[TrackLeft]) -> None:
        """See `MissionSpace`."""
        path = self._drones.paths[0, drone]
        goal.where = goal.where.after(path)
        goal.over = self._has_arrived(drone, goal.where, path)

    def _has_arrived(self, drone: int, track: TrackLeft, path: NDArray[np.float64]) -> bool:
        """Return whether a path (K + 1, 2) has come to the end of a track."""
        return has_arrived(track, path, float(self.airframes[drone].radius))

    def is_there(self, goal: Goal[TrackLeft], cell: Cell, *, is_command: bool = True) -> bool:
        """See `MissionSpace`; another command takes it on."""
        return goal.over and is_command

    def way_left(self, drone: int, goal: Goal[TrackLeft], cell: Cell) -> tuple[float, float]:
        """See `MissionSpace`; at cruise."""
        if goal.over:
            return 0.0, 0.0
        state, wind = self._drones.states[0, drone], self._drones.wind
        return way_left(goal.where, state, self.airframes[drone], wind)

    def state(self, goal: Goal[TrackLeft]) -> list[list[float]]:
        """See `MissionSpace`."""
        points: list[list[float]] = goal.where.points.tolist()
        return points

    def restored(self, state: Any) -> Goal[TrackLeft]:
        """See `MissionSpace`."""
        return Goal(TrackLeft(np.array(state)))


def space_of(env: SearchEnv) -> MissionSpace[Any]:
    """Return the space of a mission."""
    return MetresMissionSpace(env) if env.rules.in_metres else CellMissionSpace(env)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tasks of the vehicles: to do what the drones have begun to do, without ROS."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.mission import Mission
from dsse_ros.mission.step_reports import place_columns
from dsse_ros.scenario.frames import GridFrame
from dsse_ros.search import HOLD
from msg_adapters.vehicle_tasks import VEHICLE_TASK


class VehicleTasks:
    """The current task of each drone's vehicle.

    Tasks are numbered from 1 for as long as the simulation runs, so that a vehicle that has done a
    task has done that one and no other.

    Args:
        num_drones: N.

    Attributes:
        numbers: (N,) int64, numbers of the tasks; 0 before the first.
        cells: (N, 2) int64 cells (col, row) where they end.
        actions: (N,) int8, the actions of the drones, `HOLD` to stay.
        first: Number of the first task of the mission.
    """

    def __init__(self, num_drones: int) -> None:
        self.numbers = np.zeros(num_drones, np.int64)
        self.cells = np.zeros((num_drones, 2), np.int64)
        self.actions = np.full(num_drones, HOLD, np.int8)
        self.first = 1
        self._last = 0

    def restart(self, mission: Mission) -> None:
        """Have all vehicles go to the cells of their drones, at the start of a mission."""
        self.first = self._last + 1
        stay = np.full(len(self.numbers), HOLD, np.int8)
        self._set(mission, stay, np.zeros(len(stay), bool))

    def begin(self, mission: Mission, joint: NDArray[np.int8]) -> None:
        """Have the vehicles do what the drones do in the next step; those under way go on.

        Args:
            mission: The mission.
            joint: (N,) int8, commands of the drones.
        """
        self._set(mission, *mission.actions_of(joint))

    def _set(self, mission: Mission, actions: NDArray[np.int8], goes_on: NDArray[np.bool_]) -> None:
        drones = mission.env.world.drones[0]
        for i in np.flatnonzero(~goes_on & (drones["alive"] | (self.numbers < self.first))):
            self._last += 1
            self.numbers[i], self.actions[i] = self._last, actions[i]
            self.cells[i] = _end(mission, int(i), int(actions[i]))

    def points(self, mission: Mission, frame: GridFrame, run_id: int) -> NDArray[Any]:
        """Return the tasks as (N,) of `VEHICLE_TASK`.

        Args:
            mission: The mission.
            frame: Frame of its grid.
            run_id: Identity of the simulation.
        """
        points = np.zeros(len(self.numbers), VEHICLE_TASK)
        for name, values in place_columns(frame, self.cells, self.cells).items():
            points[name] = values
        points["run_id"], points["mission"] = run_id, mission.number
        points["task"], points["action"] = self.numbers, self.actions
        return points


def _end(mission: Mission, drone: int, action: int) -> tuple[int, int]:
    """Return the cell in which a drone's action ends; its own if it may not enter that one."""
    world, actions = mission.env.world, mission.env.rules.action_set
    place, grid = world.drones[0, drone], world.grid_size
    col, row = int(place["x"]), int(place["y"])
    on_grid = 0 <= col < grid and 0 <= row < grid
    if on_grid and 0 <= action < len(actions.moves) and world.mask_table[row][col][action]:
        dx, dy = actions.moves[action]
        return col + dx, row + dy
    return col, row

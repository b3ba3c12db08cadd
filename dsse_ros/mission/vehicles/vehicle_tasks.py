# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tasks of the vehicles: to do what the drones have begun to do, without ROS."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_reports import place_columns
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.frames import GridFrame
from msg_adapters.vehicle_tasks import VEHICLE_TASK


class VehicleTasks:
    """The current task of each drone's vehicle.

    Tasks are numbered from 1 for as long as the simulation runs, so that a vehicle that has done a
    task has done that one and no other.

    Args:
        mission: The mission.

    Attributes:
        numbers: (N,) int64, numbers of the tasks; 0 before the first.
        ways: (N, P, 2) float64 (col, row), the way of each, see `Mission.ways`.
        actions: (N,) int8, the actions of the drones, `NO_ACTION` to stay.
        first: Number of the first task of the mission.
    """

    def __init__(self, mission: Mission) -> None:
        num_drones = len(mission.tracks)
        self._mission = mission
        self.numbers = np.zeros(num_drones, np.int64)
        self.ways = mission.ways(None)
        self.actions = np.full(num_drones, NO_ACTION, np.int8)
        self.first = 1
        self._last = 0

    def restart(self) -> None:
        """Have all vehicles go to where their drones are, at the start of a mission."""
        self.first = self._last + 1
        self._set(None, np.zeros(len(self.numbers), bool))

    def begin(self, joint: NDArray[Any]) -> None:
        """Have the vehicles do what the drones do in the next step; those under way go on.

        Args:
            joint: (N, ...) commands of the drones, of `Mission.begin`.
        """
        self._set(*self._mission.actions_of(joint))

    def _set(self, actions: NDArray[Any] | None, goes_on: NDArray[np.bool_]) -> None:
        ways, alive = self._mission.ways(actions), self._mission.env.world.drones["alive"][0]
        chosen = np.full(len(self.numbers), NO_ACTION, np.int8)
        if actions is not None and actions.ndim == 1:
            chosen = actions
        for i in np.flatnonzero(~goes_on & (alive | (self.numbers < self.first))):
            self._last += 1
            self.numbers[i], self.ways[i], self.actions[i] = self._last, ways[i], chosen[i]

    @property
    def ends(self) -> NDArray[np.float64]:
        """Where they end, (N, 2) as (col, row)."""
        return self.ways[:, -1]

    def points(self, frame: GridFrame, run_id: int) -> NDArray[Any]:
        """Return the tasks as (P, N) of `VEHICLE_TASK`.

        Args:
            frame: Frame of the grid.
            run_id: Identity of the simulation.
        """
        ways = self.ways.swapaxes(0, 1)
        points = np.zeros(ways.shape[:2], VEHICLE_TASK)
        for name, values in place_columns(frame, np.floor(ways + 0.5), ways).items():
            points[name] = values
        points["run_id"], points["mission"] = run_id, self._mission.number
        points["task"], points["action"] = self.numbers, self.actions
        return points

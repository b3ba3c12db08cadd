# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tasks of the vehicles: to do what the drones have begun to do, without ROS."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.flight_mission import FlightMission
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
        mission: The mission.

    Attributes:
        numbers: (N,) int64, numbers of the tasks; 0 before the first.
        ways: (N, P, 2) float64 (col, row) of the way of each, in metres with fractions; elsewhere
            it is one cell, that where the task ends.
        actions: (N,) int8, the actions of the drones, `HOLD` to stay.
        first: Number of the first task of the mission.
    """

    def __init__(self, mission: Mission) -> None:
        num_drones = len(mission.tracks)
        self._mission = mission
        self.numbers = np.zeros(num_drones, np.int64)
        self.ways = _ways(mission, None)
        self.actions = np.full(num_drones, HOLD, np.int8)
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
        ways, alive = _ways(self._mission, actions), self._mission.env.world.drones["alive"][0]
        chosen = np.full(len(self.numbers), HOLD, np.int8)
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


def _ways(mission: Mission, actions: NDArray[Any] | None) -> NDArray[np.float64]:
    """Return where actions lead, (N, P, 2) (col, row); None has the drones stay.

    Between cells P is 1, and a drone that may not enter a cell stays in its own.
    """
    if isinstance(mission, FlightMission):
        return mission.ways(actions)
    world, action_set = mission.env.world, mission.env.rules.action_set
    drones = world.drones[0]
    ends = np.stack([drones["x"], drones["y"]], axis=1)
    for drone, action in enumerate([] if actions is None else actions.tolist()):
        col, row = ends[drone].tolist()
        inside = 0 <= col < world.grid_size and 0 <= row < world.grid_size
        if inside and 0 <= action < len(action_set) and world.mask_table[row][col][action]:
            ends[drone] = action_set.end((col, row), action)
    return ends[:, None].astype(np.float64)

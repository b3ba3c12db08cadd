# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far the vehicles are with their tasks, without ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.vehicles.vehicle_tasks import VehicleTasks
from dsse_ros.search.step.fault_kernels import ACTING, COMING_BACK, DONE
from dsse_ros.world.scenario.frames import GridFrame, cell_to_map
from msg_adapters.vehicles import Progress


class AwaitedVehicles:
    """State of the vehicles that follow the drones.

    Args:
        frame: Frame of the grid.
        tasks: Their tasks.
        set_battery: Called with a drone and the remaining battery share of its vehicle.

    Attributes:
        lost: Reasons why vehicles have dropped out of the mission, by drone number.
    """

    def __init__(
        self, frame: GridFrame, tasks: VehicleTasks, set_battery: Callable[[int, float], None]
    ) -> None:
        self._frame = frame
        self._tasks = tasks
        self._set_battery = set_battery
        self._places: dict[int, tuple[float, float]] = {}
        self._progress: dict[int, Progress] = {}
        self.lost: dict[int, str] = {}

    def begin(self) -> None:
        """Begin a mission: forget the positions and losses of the previous one."""
        self._places.clear()
        self.lost.clear()

    def set_place(self, drone: int, place: tuple[float, float] | None) -> None:
        """Set a vehicle's position, (x, y) in metres in the map frame; None if unknown."""
        self._places.pop(drone, None)
        if place is not None:
            self._places[drone] = place

    def set_progress(self, drone: int, progress: Progress, run_id: int) -> str | None:
        """Set a vehicle's progress; return why it is lost, None if it is not in this mission.

        Args:
            drone: Number of its drone.
            progress: The vehicle's report, possibly one from another run.
            run_id: Identity of this run.
        """
        if progress.run_id not in (0, run_id):
            progress = Progress()
        self._progress[drone] = progress
        of_this_mission = self._tasks.first <= progress.task <= self._tasks.numbers[drone]
        if not of_this_mission:
            return None
        self._set_battery(drone, progress.battery)
        return progress.lost or None

    def work(self, radius_m: float) -> NDArray[np.int8]:
        """Return what the vehicles still have to do for their tasks, (N,) of `WORKS`.

        Args:
            radius_m: Distance from the centre of a cell within which a vehicle has arrived.
        """
        drones = range(len(self._tasks.numbers))
        return np.array([self._work(i, radius_m) for i in drones], np.int8)

    def late(self, drones: Sequence[int], radius_m: float) -> list[int]:
        """Return which of the drones have vehicles that have not done their tasks; see `work`."""
        return [i for i in drones if self._work(i, radius_m) != DONE]

    def _work(self, drone: int, radius_m: float) -> int:
        """Return what a vehicle still has to do; without a report, only its position counts."""
        task, progress = int(self._tasks.numbers[drone]), self._progress.get(drone)
        if progress is None or progress.arrived_task == task:
            place = self._places.get(drone, (math.inf, math.inf))
            cell = self._tasks.ends[drone].tolist()
            if math.dist(place, cell_to_map(self._frame, *cell)) <= radius_m:
                return DONE
        has_looked = progress is not None and progress.looked_task == task
        return COMING_BACK if has_looked else ACTING

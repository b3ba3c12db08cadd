# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The vehicles that a step waits for, without ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.frames import GridFrame, cell_to_map
from msg_adapters.vehicles import Progress


class AwaitedVehicles:
    """State of the vehicles that follow the drones.

    Args:
        frame: Frame of the grid.
        set_battery: Called with a drone and the remaining battery share of its vehicle.

    Attributes:
        lost: Reasons why vehicles have dropped out of the mission, by drone number.
    """

    def __init__(self, frame: GridFrame, set_battery: Callable[[int, float], None]) -> None:
        self._frame = frame
        self._set_battery = set_battery
        self._places: dict[int, tuple[float, float]] = {}
        self._progress: dict[int, Progress] = {}
        self._first_ns = self._last_ns = 0
        self.lost: dict[int, str] = {}

    def begin(self) -> None:
        """Begin a mission: forget the positions and losses of the previous one."""
        self._places.clear()
        self.lost.clear()

    def restart_time(self) -> None:
        """Forget the reports with old stamps, because the same stamps will occur again."""
        self._progress = dict.fromkeys(self._progress, Progress())

    def set_stamp(self, stamp_ns: int, *, first: bool) -> None:
        """Set the stamp of the last step report; with `first`, earlier ones do not count."""
        self._last_ns = stamp_ns
        if first:
            self._first_ns = stamp_ns

    def set_place(self, drone: int, place: tuple[float, float] | None) -> None:
        """Set a vehicle's position, (x, y) in metres in the map frame; None if unknown."""
        self._places.pop(drone, None)
        if place is not None:
            self._places[drone] = place

    def set_progress(self, drone: int, progress: Progress, run_id: int) -> str:
        """Set a vehicle's progress; return why it is lost, "" if it is not lost in this mission.

        Args:
            drone: Number of its drone.
            progress: The vehicle's report, possibly a latched one from another run.
            run_id: Identity of this run.
        """
        if progress.run_id not in (0, run_id):
            progress = Progress()
        self._progress[drone] = progress
        of_this_mission = self._first_ns <= progress.report_stamp_ns <= self._last_ns
        if of_this_mission:
            self._set_battery(drone, progress.battery)
        return progress.lost if of_this_mission else ""

    def late(self, drones: Sequence[int], cells: NDArray[np.int64], radius_m: float) -> list[int]:
        """Return the drones whose vehicles have to arrive before the next step.

        Args:
            drones: Drones whose vehicles the step waits for.
            cells: (N, 2) cells (col, row) of all drones.
            radius_m: Distance from the centre of a cell within which a vehicle has arrived.
        """
        return [i for i in drones if not self._has_arrived(i, cells[i].tolist(), radius_m)]

    def _has_arrived(self, drone: int, cell: list[int], radius_m: float) -> bool:
        """Return whether a vehicle is in its drone's cell and, if it reports, done there."""
        progress = self._progress.get(drone)
        if progress and progress.arrived_stamp_ns != self._last_ns:
            return False
        place = self._places.get(drone, (math.inf, math.inf))
        return math.dist(place, cell_to_map(self._frame, *cell)) <= radius_m

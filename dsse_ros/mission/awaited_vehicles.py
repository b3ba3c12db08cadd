# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which vehicles a step waits for, without ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from msg_adapters.frames import GridFrame, cell_to_map
from msg_adapters.vehicles import Progress


class AwaitedVehicles:
    """What is known of the vehicles that follow the drones.

    Args:
        frame: The grid that they are in.
        set_battery: Takes the share that is left in the battery of a drone's vehicle.

    Attributes:
        lost: Why vehicles have dropped out of the mission, by the numbers of their drones.
    """

    def __init__(self, frame: GridFrame, set_battery: Callable[[int, float], None]) -> None:
        self._frame = frame
        self._set_battery = set_battery
        self._places: dict[int, tuple[float, float]] = {}
        self._progress: dict[int, Progress] = {}
        self._first_ns = self._last_ns = 0
        self.lost: dict[int, str] = {}

    def begin(self) -> None:
        """Begin a mission: where vehicles were, and which were lost, was in another one."""
        self._places.clear()
        self.lost.clear()

    def restart_time(self) -> None:
        """Forget what was reported of stamps, which come again."""
        self._progress = dict.fromkeys(self._progress, Progress())

    def set_stamp(self, stamp_ns: int, *, first: bool) -> None:
        """Take the stamp of the last step report, which may be the first that counts."""
        self._last_ns = stamp_ns
        if first:
            self._first_ns = stamp_ns

    def set_place(self, drone: int, place: tuple[float, float] | None) -> None:
        """Take where a vehicle is, (x, y) in metres in the map frame; None if it is not known."""
        self._places.pop(drone, None)
        if place is not None:
            self._places[drone] = place

    def set_progress(self, drone: int, progress: Progress, run_id: int) -> str:
        """Take how far a vehicle is; returns why it is lost, empty if it is not in this mission.

        Args:
            drone: Number of its drone.
            progress: What it reports, of another run too: that is kept for late listeners.
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
        """Return those of the drones whose vehicles have to arrive before the next step.

        Args:
            drones: Drones whose vehicles are waited for.
            cells: (N, 2) of (col, row) where all drones are.
            radius_m: Distance from the centre of a cell at which a vehicle is there.
        """
        return [i for i in drones if not self._has_arrived(i, cells[i].tolist(), radius_m)]

    def _has_arrived(self, drone: int, cell: list[int], radius_m: float) -> bool:
        """Return whether a vehicle is in its drone's cell and, if it reports, done there."""
        progress = self._progress.get(drone)
        if progress and progress.arrived_stamp_ns != self._last_ns:
            return False
        place = self._places.get(drone, (math.inf, math.inf))
        return math.dist(place, cell_to_map(self._frame, *cell)) <= radius_m

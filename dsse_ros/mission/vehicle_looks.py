# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""From where the vehicles of drones on cells have looked, without ROS."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.mission import Mission
from dsse_ros.mission.passed_cells import PassedCells
from dsse_ros.mission.vehicle_tasks import VehicleTasks
from dsse_ros.step.fault_kernels import ACTING
from dsse_ros.step.viewpoints import NO_LOOK, VIEWPOINTS

Way = tuple[NDArray[np.float64], NDArray[np.bool_]]
"""What a vehicle has flown in a step, as `Flown.paths` and `Flown.looked` have it of a drone."""

MOST_WAITING = 4
"""Looks of a vehicle in a step, of which all but one wait; beyond, the oldest is left out."""
_COURSE_CELLS = 0.25
"""Length of the way before a pass, in cells, that shows in which direction a vehicle flew."""


class VehicleLooks:
    """The looks of the vehicles: those of moves where they pass cells, and those of searches.

    A drone looks from one cell in a step. What its vehicle passes besides, it looks at in the next
    steps.

    Args:
        mission: The mission.
    """

    def __init__(self, mission: Mission) -> None:
        world, moves = mission.env.world, mission.env.rules.action_set.moves
        self._cell_m, self._grid_size = mission.env.scenario.cell_size, world.grid_size
        self._search = mission.env.rules.action_set.search
        lengths = [math.hypot(*move) for move in moves]
        self._moves = np.array(
            [np.divide(move, length or 1.0) for move, length in zip(moves, lengths, strict=True)]
        )
        # (N, A), the moves that look.
        looks = world.looks.counts[world.looks.kind] > 0
        self._look_moving = looks & (np.array(lengths) > 0.0)
        self._waiting: list[deque[tuple[int, int, int]]] = [
            deque(maxlen=MOST_WAITING) for _ in range(world.num_drones)
        ]
        self._passed = [PassedCells(self._cell_m, self._grid_size) for _ in range(world.num_drones)]
        self._searched = np.zeros(world.num_drones, np.int64)

    def begin(self) -> None:
        """Begin a mission."""
        for waiting, passed in zip(self._waiting, self._passed, strict=True):
            waiting.clear()
            passed.begin()

    def take(
        self,
        flown: Mapping[int, Way],
        tasks: VehicleTasks,
        work: NDArray[np.int8],
    ) -> NDArray[np.void]:
        """Return from where the drones look in a step, (N,) of `viewpoints.VIEWPOINTS`.

        A vehicle has searched once it has looked for its task, in the cell where it was then.

        Args:
            flown: What the vehicles have flown in the step, by drone, as far as that is known.
            tasks: Their tasks.
            work: (N,) of `fault_kernels.WORKS`, what they still have to do.
        """
        looks = np.zeros(len(work), VIEWPOINTS)
        looks["action"] = NO_LOOK
        new = (tasks.numbers != self._searched) & (tasks.actions == self._search)
        searched = new & (work != ACTING)
        self._searched[searched] = tasks.numbers[searched]
        for drone, of_drone in flown.items():
            self._add_passes(drone, *of_drone)
            if searched[drone]:
                self._add_search(drone, *of_drone)
        for drone, waiting in enumerate(self._waiting):
            if waiting:
                looks["x"][drone], looks["y"][drone], looks["action"][drone] = waiting.popleft()
        return looks

    def _add_passes(self, drone: int, path: NDArray[np.float64], looked: NDArray[np.bool_]) -> None:
        able = self._look_moving[drone]
        for (col, row), piece in self._passed[drone].take(path, looked) if able.any() else []:
            ways = path[piece + 1] - path[: piece + 1]
            far = np.flatnonzero(np.hypot(*ways.T) >= _COURSE_CELLS * self._cell_m)
            course = self._moves @ ways[far[-1] if len(far) else 0]
            action = int(np.where(able, course, -np.inf).argmax())
            self._waiting[drone].append((col, row, action))

    def _add_search(self, drone: int, path: NDArray[np.float64], looked: NDArray[np.bool_]) -> None:
        seen = np.flatnonzero(looked[1:])
        if not len(seen):
            return
        col, row = np.floor(path[seen[-1] + 1] / self._cell_m).astype(np.int64).tolist()
        if 0 <= col < self._grid_size and 0 <= row < self._grid_size:
            self._waiting[drone].append((col, row, self._search))

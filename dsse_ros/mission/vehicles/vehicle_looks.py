# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The cells that vehicles of drones on cells pass, and their looks there, without ROS."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.vehicles.vehicle_tasks import VehicleTasks
from dsse_ros.search.step.fault_kernels import ACTING
from dsse_ros.search.step.viewpoints import NO_LOOK, VIEWPOINTS
from dsse_ros.world.scenario.actions import Cell

Way = tuple[NDArray[np.float64], NDArray[np.bool_]]
"""What a vehicle has flown in a step, as `Flown.paths` and `Flown.looked` have it of a drone."""

MOST_WAITING = 4
"""Looks of a vehicle in a step, of which all but one wait; beyond, the oldest is left out."""
_COURSE_CELLS = 0.25
"""Length of the way before a pass, in cells, that shows in which direction a vehicle flew."""


class Pass(NamedTuple):
    """A pass over a cell.

    Attributes:
        cell: (col, row).
        piece: Number of the piece of the path on which the vehicle first looked at it.
    """

    cell: Cell
    piece: int


class PassedCells:
    """Finds the cells that one vehicle passes.

    It passes a cell if it looks within half a cell of its centre, and again only after it has been
    outside the circle through its corners. On straight paths of any course these are on average as
    many cells as the path is long. The cell where it begins is not passed.

    Args:
        cell_m: Side of a cell.
        grid: Shape of the grid.
        beyond: Cells beyond the edge of the grid, from which its sensor sees some of the grid.
    """

    def __init__(self, cell_m: float, grid: GridShape, beyond: int = 0) -> None:
        self._cell_m, self._grid, self._beyond = cell_m, grid, beyond
        # The passed cells near the vehicle; None before it begins.
        self._passed: set[Cell] | None = None

    def begin(self) -> None:
        """Begin a mission where the vehicle is then."""
        self._passed = None

    def take(self, path: NDArray[np.float64], looked: NDArray[np.bool_]) -> list[Pass]:
        """Return the passes of a step in their order.

        Args:
            path: (K + 1, 2) float64, metres to the east and to the south of the grid's north-west
                corner.
            looked: (K + 1,) bool, see `step.metres_detection.missed`.
        """
        cells = self._cells_near(path)
        centres, legs = (np.array(cells).reshape(-1, 2) + 0.5) * self._cell_m, np.diff(path, axis=0)
        # (K, C, 2) from the beginning of each piece to each centre, and (K, C) the nearest share.
        to = centres - path[:-1, None]
        squared = np.maximum((legs**2).sum(axis=1), 1e-12)
        share = np.clip((to * legs[:, None]).sum(axis=2) / squared[:, None], 0.0, 1.0)
        within = np.hypot(*np.moveaxis(to - share[..., None] * legs[:, None], 2, 0))
        within = within <= self._cell_m / 2
        inside = np.hypot(*np.moveaxis(centres - path[:, None], 2, 0))
        if self._passed is None:
            self._passed = {cells[i] for i in np.flatnonzero(inside[0] <= self._cell_m / 2)}
        passes = []
        for k in range(len(legs)):
            for i in np.flatnonzero(within[k] & looked[k + 1]).tolist():
                if cells[i] not in self._passed:
                    passes.append(Pass(cells[i], k))
                    self._passed.add(cells[i])
            near = np.flatnonzero(inside[k + 1] <= self._cell_m / math.sqrt(2.0))
            self._passed &= {cells[i] for i in near}
        return passes

    def _cells_near(self, path: NDArray[np.float64]) -> list[Cell]:
        """Return the cells of the grid, and those beyond its edge, around a path."""
        low = np.floor(path.min(axis=0) / self._cell_m).astype(np.int64) - 1
        high = np.floor(path.max(axis=0) / self._cell_m).astype(np.int64) + 1
        west, north = np.maximum(low, -self._beyond).tolist()
        east, south = np.minimum(high, np.array(self._grid) - 1 + self._beyond).tolist()
        return [(col, row) for row in range(north, south + 1) for col in range(west, east + 1)]


class VehicleLooks:
    """The looks of the vehicles: those of moves where they pass cells, and those of searches.

    A drone looks from one cell in a step. What its vehicle passes besides, it looks at in the next
    steps.

    Args:
        mission: The mission.
    """

    def __init__(self, mission: Mission) -> None:
        world, moves = mission.env.world, mission.env.rules.action_set.moves
        self._cell_m, self._grid = mission.env.scenario.cell_size, world.grid_size
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
        self._beyond = int(np.abs(world.looks.offsets).max(initial=0))
        self._passed = [
            PassedCells(self._cell_m, self._grid, self._beyond) for _ in range(world.num_drones)
        ]
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
        if self._grid.padded(self._beyond).holds(col + self._beyond, row + self._beyond):
            self._waiting[drone].append((col, row, self._search))

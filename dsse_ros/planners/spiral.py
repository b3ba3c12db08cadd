# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Spiral search: around the datum and outwards, for one or more drones.

An Archimedean spiral with a track spacing of one cell. N drones fly N arms, rotated evenly around
the datum. The turns of one arm are N cells apart, with the other arms between them. The datum is
the most probable cell at the first observation.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, pi

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.planner import Cell
from dsse_ros.world.scenario.actions import ActionSet, connected_components
from dsse_ros.world.scenario.probable_cells import datum_of


def spiral_routes(
    cells: Sequence[Cell], probability: NDArray[np.float32], actions: Sequence[ActionSet]
) -> list[list[Cell]]:
    """Return the route of each drone; together the routes visit every reachable cell once.

    The arms are assigned to the drones clockwise, as seen from the datum.

    Args:
        cells: Present cell of each drone.
        probability: Map (R, C); the most probable cell is the datum.
        actions: Actions of each drone, with the area if there is one.
    """
    datum = datum_of(probability)
    routes = [[cell] for cell in cells]
    for members, component in connected_components(actions, cells):
        drones = sorted(members, key=lambda drone: turns(datum, cells[drone]))
        for drone, arm in zip(
            drones, arms(datum, GridShape.of(probability), len(drones)), strict=True
        ):
            kept = arm if component is None else arm[component[arm[:, 1], arm[:, 0]]]
            # On a small grid an arm may be empty.
            routes[drone] = [*zip(*kept.T.tolist(), strict=True)] or routes[drone]
    return routes


def arms(datum: Cell, grid: GridShape, count: int) -> list[NDArray[np.int64]]:
    """Return the cells (K, 2) as (col, row) of each arm of the spiral, outwards."""
    row, col = np.indices(grid.matrix).reshape(2, -1)
    east, south = col - datum[0], row - datum[1]
    radius = np.sqrt(east**2 + south**2)
    # NumPy's arctan2 is not the same on all machines.
    angle = np.array([*map(atan2, south.tolist(), east.tolist())]) / (2 * pi) % 1.0
    # Arm i crosses this angle at the radii count * (angle + m) - i, m = 0, 1, ...
    winding = np.rint(radius - count * angle).astype(np.int64)
    arm_of = -winding % count
    along = (winding + arm_of) / count + angle
    cells = np.stack([col, row], axis=1)
    order = np.lexsort((row, col, along))
    return [cells[order[arm_of[order] == arm]] for arm in range(count)]


def turns(datum: Cell, cell: Cell) -> float:
    """Return the bearing of a cell from the datum, in turns clockwise from east, from 0 to 1."""
    return atan2(cell[1] - datum[1], cell[0] - datum[0]) / (2 * pi) % 1.0

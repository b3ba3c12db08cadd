# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Spiral search: around the datum and outwards, for one or more drones.

An Archimedean spiral with a track spacing of one cell. N drones fly N arms, rotated evenly around
the datum. The turns of one arm are N cells apart, with the other arms between them. The datum is
the most probable cell at the first observation.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, hypot, pi

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.planner import Cell
from dsse_ros.scenario.actions import ActionSet, connected_components
from dsse_ros.scenario.probable_cells import most_probable


def spiral_routes(
    cells: Sequence[Cell], probability: NDArray[np.float32], actions: Sequence[ActionSet]
) -> list[list[Cell]]:
    """Return the route of each drone; together the routes visit every reachable cell once.

    The arms are assigned to the drones clockwise, as seen from the datum.

    Args:
        cells: Present cell of each drone.
        probability: Map (G, G); the most probable cell is the datum.
        actions: Actions of each drone, with the area if there is one.
    """
    datum = most_probable(probability, 1)[0]
    routes = [[cell] for cell in cells]
    for members, component in connected_components(actions, cells):
        drones = sorted(members, key=lambda drone: turns(datum, cells[drone]))
        for drone, arm in zip(drones, arms(datum, len(probability), len(drones)), strict=True):
            route = [(col, row) for col, row in arm if component is None or component[row, col]]
            # On a small grid an arm may be empty.
            routes[drone] = route or routes[drone]
    return routes


def arms(datum: Cell, size: int, count: int) -> list[list[Cell]]:
    """Return the cells of each arm of the spiral, outwards."""
    places: list[list[tuple[float, Cell]]] = [[] for _ in range(count)]
    for row in range(size):
        for col in range(size):
            cell = (col, row)
            radius, angle = hypot(col - datum[0], row - datum[1]), turns(datum, cell)
            # Arm i crosses this angle at the radii count * (angle + m) - i, m = 0, 1, ...
            winding = round(radius - count * angle)
            arm = -winding % count
            places[arm].append(((winding + arm) / count + angle, cell))
    return [[cell for _, cell in sorted(arm)] for arm in places]


def turns(datum: Cell, cell: Cell) -> float:
    """Return the bearing of a cell from the datum, in turns clockwise from east, from 0 to 1."""
    return atan2(cell[1] - datum[1], cell[0] - datum[0]) / (2 * pi) % 1.0

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Expanding square search (SS) of the IAMSAR manual, vol. II, for one or more drones.

The search starts at the datum and goes around it in legs of 1, 1, 2, 2, 3, 3, ... track
spacings. All turns are 90 degrees to starboard. The datum is the most probable cell at the first
observation, and the track spacing is one cell. The first leg goes north: the manual lays it into
the wind, which is not observed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from math import atan2, pi

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.patterns import square_legs
from dsse_ros.planners.planner import Cell
from dsse_ros.world.scenario.actions import ActionSet, connected_components
from dsse_ros.world.scenario.probable_cells import datum_of

_MOVES = {0: (0, -1), 90: (1, 0), 180: (0, 1), 270: (-1, 0)}
"""Move (d_col, d_row) of each heading."""


def square_routes(
    cells: Sequence[Cell], probability: NDArray[np.float32], actions: Sequence[ActionSet]
) -> list[list[Cell]]:
    """Return the route of each drone; together the routes visit every reachable cell once.

    One drone flies the square spiral. Several drones share it: each ring around the datum is cut
    into contiguous arcs, one per drone. A drone's arcs stay on about the same side of the datum.
    The arcs are assigned to the drones clockwise, as seen from the datum.

    Args:
        cells: Present cell of each drone.
        probability: Map (R, C); the most probable cell is the datum.
        actions: Actions of each drone; they measure the distance to the ends of an arc.
    """
    grid = GridShape.of(probability)
    datum = datum_of(probability)
    routes = [[cell] for cell in cells]
    for members, component in connected_components(actions, cells):
        drones = sorted(members, key=lambda drone: _clockwise(datum, cells[drone]))
        shared = shared_square(datum, grid, [actions[drone] for drone in drones], component)
        for drone, route in zip(drones, shared, strict=True):
            routes[drone] = route or routes[drone]
    return routes


def square_spiral(datum: Cell, grid: GridShape) -> Iterator[Cell]:
    """Yield the datum and the cells around it, leg by leg, without those outside the grid."""
    yield datum
    left = grid.cells - 1
    col, row = datum
    for heading_deg, length in square_legs(2 * grid.longer):
        d_col, d_row = _MOVES[int(heading_deg)]
        for _ in range(int(length)):
            if not left:
                return
            col, row = col + d_col, row + d_row
            if grid.holds(col, row):
                left -= 1
                yield col, row


def shared_square(
    datum: Cell,
    grid: GridShape,
    actions: Sequence[ActionSet],
    component: NDArray[np.bool_] | None = None,
) -> list[list[Cell]]:
    """Divide the square spiral into one route per drone, clockwise from the north-west diagonal.

    A drone enters its arc of the next ring at the nearer end. The lengths of the routes differ
    by one at most.

    Args:
        datum: First cell of the spiral.
        grid: Its shape.
        actions: Actions of each drone.
        component: (R, C) bool [row, col], the cells to share; None for all.
    """
    drones, spiral = len(actions), square_spiral(datum, grid)
    if component is not None:
        spiral = ((col, row) for col, row in spiral if component[row, col])
    if drones == 1:
        return [list(spiral)]
    routes: list[list[Cell]] = [[] for _ in range(drones)]
    rings = groupby(
        spiral,
        key=lambda cell: max(abs(cell[0] - datum[0]), abs(cell[1] - datum[1])),
    )
    for _, ring in rings:
        cells = list(ring)
        each, more = divmod(len(cells), drones)
        favoured = set(sorted(range(drones), key=lambda i: len(routes[i]))[:more])
        start = 0
        for i, route in enumerate(routes):
            end = start + each + (i in favoured)
            arc = cells[start:end]
            if route and arc:
                first, last = (actions[i].distance(route[-1], arc[k]) for k in (0, -1))
                if last < first:
                    arc.reverse()
            route += arc
            start = end
    return routes


def _clockwise(datum: Cell, cell: Cell) -> float:
    """Return the bearing of a cell from the datum in rad, clockwise from the north-west."""
    return (atan2(cell[1] - datum[1], cell[0] - datum[0]) + 0.75 * pi) % (2 * pi)

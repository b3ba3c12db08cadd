# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sector search (VS) of the IAMSAR manual, vol. II and III, for one or more drones.

The search passes the datum again and again. A pattern is three equilateral triangles with a corner
at the datum. All turns are 120 degrees to starboard, and the datum is crossed without a turn. The
next pattern is rotated by 30 degrees. The datum is the most probable cell at the first observation.
The first leg goes north: the manual aligns it with the drift, which is not observed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import count, islice
from math import hypot

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.pattern_routes import cells_along
from dsse_ros.planners.patterns import TRIANGLE_HEADINGS_DEG, triangle_legs, turning_points
from dsse_ros.planners.planner import Cell
from dsse_ros.world.scenario.actions import ActionSet, connected_components
from dsse_ros.world.scenario.probable_cells import datum_of

PATTERN_TURN_DEG = 30


def sector_routes(
    cells: Sequence[Cell], probability: NDArray[np.float32], actions: Sequence[ActionSet]
) -> list[list[Cell]]:
    """Return the route of each drone; together the routes form whole patterns.

    One drone flies the triangles one after the other. Several drones take them in turn.

    Args:
        cells: Present cell of each drone.
        probability: Map (R, C); the most probable cell is the datum.
        actions: Actions of each drone, with the area if there is one.
    """
    grid = GridShape.of(probability)
    datum = datum_of(probability)
    farthest = hypot(*(max(c, size - 1 - c) for c, size in zip(datum, grid, strict=True)))
    routes = [[cell] for cell in cells]
    for drones, component in connected_components(actions, cells):
        # Patterns until one reaches beyond the grid, repeated so that each drone has as many
        # triangles.
        count = 3 * len(drones) * _patterns(farthest, grid)
        legs = list(islice(triangles(datum, grid), count))
        for i, drone in enumerate(drones):
            flown = [cell for k, leg in enumerate(legs[i :: len(drones)]) for cell in leg[k > 0 :]]
            route = _inside(flown, grid, component)
            routes[drone] = route or routes[drone]
    return routes


def _inside(cells: list[Cell], grid: GridShape, component: NDArray[np.bool_] | None) -> list[Cell]:
    """Return the cells that are on the grid and, with an area, in this connected component."""
    inside = [cell for cell in cells if grid.holds(*cell)]
    return (
        inside if component is None else [(col, row) for col, row in inside if component[row, col]]
    )


def _patterns(farthest: float, grid: GridShape) -> int:
    """Return how many patterns there are up to and including both of the greatest radius."""
    return 2 * max(1, -int(-farthest // _radius(grid)))


def _radius(grid: GridShape) -> int:
    """Return the radius of the first pattern in cells: a quarter of the grid's shorter side."""
    return max(1, grid.shorter // 4)


def triangles(datum: Cell, grid: GridShape) -> Iterator[list[Cell]]:
    """Yield the cells of one triangle after the other, from the datum to the datum.

    Every second pattern fills the gaps of the one before; the pattern after it reaches farther.
    """
    for pattern in count():
        radius = _radius(grid) * (1 + pattern // 2)
        for heading_deg in TRIANGLE_HEADINGS_DEG:
            first_deg = heading_deg + PATTERN_TURN_DEG * (pattern % 2)
            start = float(datum[0]), -float(datum[1])
            corners = turning_points(start, triangle_legs(first_deg, radius))
            yield cells_along([(east, -north) for east, north in corners])

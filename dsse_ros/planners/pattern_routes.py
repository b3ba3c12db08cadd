# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Search patterns given in metres as routes over the cells of the grid."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.patterns import SearchPattern
from dsse_ros.planners.planner import Cell
from dsse_ros.planners.sweep import split
from dsse_ros.world.scenario.actions import ActionSet, connected_components
from dsse_ros.world.scenario.probable_cells import datum_of


@dataclass(frozen=True)
class PatternRoutes:
    """The routes of drones along one search pattern, a `RouteLayout`.

    Each drone flies a contiguous stretch of the track, all as long to within a cell; the first
    one starts at the commence search point. Cells outside the grid and the area are left out.

    Attributes:
        pattern: The pattern; its headings count from the north of the grid.
        cell_size_m: Side of a cell.
        datum: Cell (col, row); None for the most probable one at the first observation.
    """

    pattern: SearchPattern
    cell_size_m: float
    datum: Cell | None = None

    def __call__(
        self,
        cells: Sequence[Cell],
        probability: NDArray[np.float32],
        actions: Sequence[ActionSet],
    ) -> list[list[Cell]]:
        """Return the route of each drone, its present cell if no cell is left for it."""
        datum = self.datum or datum_of(probability)
        points = datum + self.pattern.track.points_m / self.cell_size_m * (1, -1)
        grid = GridShape.of(probability)
        flown = cells_along(points.tolist())
        inside = [cell for cell in flown if grid.holds(*cell)]
        routes = [[cell] for cell in cells]
        for drones, component in connected_components(actions, cells):
            reached = [c for c in inside if component is None or component[c[1], c[0]]]
            for drone, piece in zip(drones, split(len(reached), len(drones)), strict=True):
                routes[drone] = reached[piece.start : piece.stop] or routes[drone]
        return routes


def cells_along(points: Iterable[Sequence[float]]) -> list[Cell]:
    """Return the cells along straight legs, each a neighbour of the last.

    Args:
        points: Turning points (col, row) with fractions; whole numbers are centres of cells.
    """
    cells: list[Cell] = []
    for (col, row), (end_col, end_row) in pairwise(points):
        steps = max(1, abs(round(end_col) - round(col)), abs(round(end_row) - round(row)))
        leg = [
            (round(col + (end_col - col) * k / steps), round(row + (end_row - row) * k / steps))
            for k in range(steps + 1)
        ]
        cells += leg[1:] if cells else leg
    return cells

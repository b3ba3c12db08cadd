# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parallel track and creeping line search: divide the grid among the drones.

Each drone covers its share lane by lane, along the long or along the short side of the share.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.planner import Cell
from dsse_ros.world.scenario.actions import ActionSet, connected_components


def sweep_routes(
    cells: Sequence[Cell],
    probability: NDArray[np.float32],
    actions: Sequence[ActionSet],
    *,
    creeping: bool = False,
) -> list[list[Cell]]:
    """Return the route of each drone through its share, from the corner nearest to it.

    The shares are assigned from west to east, then from north to south, so that drones at the
    default start (row by row from the north-west corner) never cross on their way there.

    In an area, the reachable cells are listed lane by lane and cut into pieces of equal length,
    one per drone.

    Args:
        cells: Present cell of each drone.
        probability: Any map (R, C); only its size matters.
        actions: Actions of each drone; they measure the distance to the corners.
        creeping: Whether lanes go from west to east and not from north to south.
    """
    lay = _creeping_line if creeping else boustrophedon
    routes = [[cell] for cell in cells]
    for members, component in connected_components(actions, cells):
        drones = sorted(members, key=lambda drone: cells[drone])
        blocks = shares(GridShape.of(probability), len(drones)) if component is None else None
        pieces = None if component is None else _pieces(component, len(drones), lay)
        for k, drone in enumerate(drones):
            able, cell = actions[drone], cells[drone]
            if blocks is not None:
                cols, rows = blocks[k]
                corners = [(c, r) for r in (rows, rows[::-1]) for c in (cols, cols[::-1])]
                routes[drone] = lay(
                    *corners[_nearest(able, cell, [(c[0], r[0]) for c, r in corners])]
                )
            elif pieces is not None and pieces[k]:
                ways = (pieces[k], pieces[k][::-1])
                routes[drone] = ways[_nearest(able, cell, [way[0] for way in ways])]
    return routes


def _nearest(actions: ActionSet, cell: Cell, ends: Sequence[Cell]) -> int:
    """Return the number of the first of the nearest cells that a drone can reach, if it can any."""
    lengths = [actions.distance(cell, end) for end in ends]
    return lengths.index(min((length for length in lengths if length >= 0), default=lengths[0]))


def _pieces(
    component: NDArray[np.bool_], count: int, lay: Callable[[range, range], list[Cell]]
) -> list[list[Cell]]:
    """Return the cells of a component lane by lane, cut into pieces of about equal length."""
    rows, cols = map(range, component.shape)
    lanes = [cell for cell in lay(cols, rows) if component[cell[1], cell[0]]]
    return [lanes[piece.start : piece.stop] for piece in split(len(lanes), count)]


def shares(grid: GridShape, count: int) -> list[tuple[range, range]]:
    """Divide a grid into at most as many blocks (columns, rows) as it has cells.

    The blocks are vertical strips whose widths differ by one at most. With more blocks than
    columns, each column is cut into bands of rows. They are ordered by column, then row.
    """
    if count <= grid.columns:
        return [(cols, range(grid.rows)) for cols in split(grid.columns, count)]
    each, more = divmod(count, grid.columns)
    return [
        (range(col, col + 1), rows)
        for col in range(grid.columns)
        for rows in split(grid.rows, each + (col < more))
    ]


def split(length: int, parts: int) -> list[range]:
    """Cut range(length) into consecutive ranges whose lengths differ by one at most."""
    ends = [part * length // parts for part in range(parts + 1)]
    return [range(a, b) for a, b in zip(ends, ends[1:], strict=False)]


def boustrophedon(cols: range, rows: range) -> list[Cell]:
    """Return the cells of a block column by column, every second column in reverse."""
    return [
        (col, row)
        for turn, col in enumerate(cols)
        for row in (rows if turn % 2 == 0 else rows[::-1])
    ]


def _creeping_line(cols: range, rows: range) -> list[Cell]:
    """Return the cells of a block row by row, every second row in reverse."""
    return [(col, row) for row, col in boustrophedon(rows, cols)]

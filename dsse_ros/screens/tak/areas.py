# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The smallest areas that hold a share of the POC, as polygons on the Earth, by shapely."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import map_to_geodetic

MAX_POINTS = 100
"""Largest number of points of a ring: a datagram of Cursor on Target holds them."""

Ring = list[tuple[float, float]]
"""Points (lat, lon) in degrees, the first one again at the end."""


def smallest_area(poc: NDArray[np.floating], share: float) -> NDArray[np.bool_]:
    """Return the smallest set of cells that holds a share of a map.

    Args:
        poc: (R, C) POC of each cell.
        share: The share of its sum, above 0 to 1.

    Returns:
        (R, C) bool; no cell if there is no POC.
    """
    flat = poc.ravel().astype(np.float64)
    order = np.argsort(-flat, kind="stable")
    before = np.concatenate([[0.0], np.cumsum(flat[order])[:-1]])
    inside = np.zeros(flat.size, np.bool_)
    inside[order[(before < share * flat.sum()) & (flat[order] > 0)]] = True
    return inside.reshape(poc.shape)


def outlines(frame: GridFrame, inside: NDArray[np.bool_], most: int) -> list[Ring]:
    """Return the outer rings of cells, the largest first.

    Args:
        frame: The grid.
        inside: (R, C) bool [row, col], row 0 in the north.
        most: Largest number of rings; smaller ones are left out.
    """
    # One box for each run of cells in a row.
    edges = np.diff(np.pad(inside.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    (rows, starts), (_, ends) = np.nonzero(edges == 1), np.nonzero(edges == -1)
    cell_m, norths = frame.cell_size_m, frame.grid_size.rows - rows
    boxes = shapely.box(starts * cell_m, (norths - 1) * cell_m, ends * cell_m, norths * cell_m)
    parts = [part for part in shapely.get_parts(shapely.union_all(boxes)) if not part.is_empty]
    parts.sort(key=lambda part: -part.area)
    return [_ring(frame, part.exterior) for part in parts[:most]]


def _ring(frame: GridFrame, ring: shapely.LinearRing) -> Ring:
    """Return a ring on the Earth, with as little of its shape lost as `MAX_POINTS` allow."""
    shape, tolerance_m = ring.simplify(0.0), frame.cell_size_m / 2
    while shapely.get_num_coordinates(shape) > MAX_POINTS:
        shape, tolerance_m = ring.simplify(tolerance_m), 2 * tolerance_m
    east, north = shapely.get_coordinates(shape).T
    lat, lon, _ = map_to_geodetic(frame, east, north, 0.0)
    return list(zip(lat.tolist(), lon.tolist(), strict=True))

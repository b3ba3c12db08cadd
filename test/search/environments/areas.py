# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Random areas of a grid: islands, holes, lakes and channels of one cell, and their polygons."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from dsse_ros.world.scenario.geodesy import surface_to_geodetic

ORIGIN = (-24.04, -46.17, 0.0)
CELL_M = 130.0


def random_mask(rng: np.random.Generator, size: int) -> NDArray[np.bool_]:
    """Cells (G, G) of an area: rectangles and walks of one cell's width, then islands in them."""
    mask = np.zeros((size, size), bool)
    for _ in range(rng.integers(0, 3)):
        (x0, x1), (y0, y1) = np.sort(rng.integers(0, size, (2, 2)), axis=1)
        mask[y0 : y1 + 1, x0 : x1 + 1] = True
    for _ in range(rng.integers(1, 4)):
        x, y = rng.integers(0, size, 2)
        for _ in range(3 * size):
            mask[y, x] = True
            dx, dy = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1))[rng.integers(5)]
            x, y = np.clip((x + dx, y + dy), 0, size - 1)
    for _ in range(rng.integers(0, size)):
        x, y = rng.integers(0, size, 2)
        if mask.sum() > 6:
            mask[y, x] = False
    return mask


def geojson_of(mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Polygons that hold these cells and no others, with holes."""
    size = len(mask)
    rows, cols = np.nonzero(mask)
    x, y = cols * CELL_M, (size - 1 - rows) * CELL_M
    union = shapely.unary_union(shapely.box(x, y, x + CELL_M, y + CELL_M))

    def to_lon_lat(points: NDArray[np.float64]) -> NDArray[np.float64]:
        lat, lon = surface_to_geodetic(ORIGIN, points[:, 0], points[:, 1])
        return np.stack([lon, lat], axis=1)

    geojson: dict[str, Any] = json.loads(shapely.to_geojson(shapely.transform(union, to_lon_lat)))
    return geojson


def scenario_of(mask: NDArray[np.bool_], rng: np.random.Generator, drones: int) -> dict[str, Any]:
    """A scenario of this area: drones and the person in random cells of it."""
    cells = np.argwhere(mask)[:, ::-1]
    starts = rng.permutation(cells)[: min(drones, len(cells))]
    return {
        "area": geojson_of(mask),
        "grid_size": len(mask),
        "cell_size": CELL_M,
        "origin_lat": ORIGIN[0],
        "origin_lon": ORIGIN[1],
        "drones_positions": starts.tolist(),
        "person_initial_position": rng.choice(cells).tolist(),
        "vector": rng.uniform(-1, 1, 2).tolist(),
        "sigma": float(rng.uniform(0.5, 5)),
        "timestep_limit": 40,
    }

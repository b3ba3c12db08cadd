# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The land of an incident, which boats cannot search."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.step.polylines import along, points_at
from dsse_ros.world.scenario.geodesy import search_to_geodetic
from dsse_ros.world.scenario.scenario import ResolvedScenario, scenario_frame

RASTER = 400
"""Points along a side of the square that is known."""
BEYOND = 0.5
"""How far it reaches beyond each edge of the grid, in longer sides of the grid."""


class Land:
    """The shore of an incident as a raster; what is far from the grid counts as sea.

    Args:
        scenario: The scenario.
    """

    def __init__(self, scenario: ResolvedScenario) -> None:
        frame = scenario_frame(scenario)
        longer_m = max(frame.extent)
        self._from_m = -BEYOND * longer_m
        self._cell_m = (1 + 2 * BEYOND) * longer_m / RASTER
        self._is_land: NDArray[np.bool_] | None = None
        if scenario.incident is not None and scenario.incident.land is not None:
            centres = self._from_m + (np.arange(RASTER) + 0.5) * self._cell_m
            east, south = np.meshgrid(centres, centres)
            lats, lons = search_to_geodetic(frame, east, south)
            # As the polygons have them.
            lons = (lons + 180.0) % 360.0 - 180.0
            self._is_land = scenario.incident.land.prepared()(lats, lons)

    def share_of(self, track: NDArray[np.float64]) -> float:
        """Return the share of a track, (K, 2) metres to the east and south, that is on land."""
        if self._is_land is None:
            return 0.0
        lengths = along(track)
        count = max(math.ceil(lengths[-1] / self._cell_m), 1)
        points = points_at(track, np.linspace(0.0, lengths[-1], count + 1))
        col, row = np.floor((points - self._from_m) / self._cell_m).astype(np.int64).T
        known = (col >= 0) & (col < RASTER) & (row >= 0) & (row < RASTER)
        return float(self._is_land[row[known], col[known]].sum() / len(points))

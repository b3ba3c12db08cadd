# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where drones in metres were in the grid, from a record."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.scenario import ResolvedScenario

_OF_LEG = 8
"""Points for each cell of a leg, to find the cells that it crosses."""
_TOLERANCE = 1e-4
"""A log has three decimals of a metre, a report float32."""


def places_of(
    scenario: ResolvedScenario, east_m: NDArray[np.float64], north_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (col, row) of positions (K, N) from the south-west corner, (K, N, 2).

    Fractions lie between cells.
    """
    cell_m = scenario.cell_size
    places = [east_m / cell_m - 0.5, scenario.grid_size - 0.5 - north_m / cell_m]
    return np.stack(places, axis=-1).astype(np.float64)


def check_flown(places: NDArray[np.float64], cells: NDArray[np.int64]) -> None:
    """Raise unless places (K, N, 2) lie in their cells.

    Raises:
        ValueError: If they do not.
    """
    away = np.abs(places - cells)
    # This form of the comparison also refuses NaN.
    if not (away <= 0.5 + _TOLERANCE).all():
        raise ValueError("scenario: the recorded positions do not lie in their cells")


def flown_over(
    places: NDArray[np.float64], acted: NDArray[np.bool_], grid_size: int
) -> NDArray[np.int64]:
    """Return the cells under the straight legs between recorded steps.

    Args:
        places: (K, N, 2) (col, row) of the drones.
        acted: (K, N) which drones flew in each step.
        grid_size: Cells along a side of the grid.

    Returns:
        (Q, 4) as (number of the step, drone, col, row), each once.
    """
    before, drones = np.nonzero(acted[1:])
    legs = places[before + 1, drones] - places[before, drones]
    shares = np.linspace(0.0, 1.0, int(_OF_LEG * np.abs(legs).max(initial=1.0)) + 2)
    way = places[before, drones][:, None] + shares[:, None] * legs[:, None]
    cells = np.clip(np.floor(way + 0.5), 0, grid_size - 1).astype(np.int64)
    steps = np.stack([before + 1, drones], axis=1)[:, None].repeat(len(shares), axis=1)
    return np.unique(np.concatenate([steps, cells], axis=2).reshape(-1, 4), axis=0)

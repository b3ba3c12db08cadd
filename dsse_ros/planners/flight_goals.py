# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Goals of drones in metres on a map: a likely cell near each drone, a different one for each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.matching import best_pairs

CLOSENESS = 0.7
"""Factor on the probability of a cell for each step's flight to it."""


def goals_on_map(
    probability: NDArray[np.floating],  # type: ignore[type-arg]
    flights: NDArray[np.void],
    cell_m: float,
    legs_m: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the centre of a cell for each drone, (N, 2), metres to the east and to the south.

    Among the remaining drones and cells, the pair is matched with the greatest probability times
    `CLOSENESS` to the power of the distance. A drone without a cell flies to the grid's middle.

    Args:
        probability: (G, G) as [row, col].
        flights: (N,) of `flight_paths.FLIGHTS`.
        cell_m: Side of a cell.
        legs_m: (N,) float64, the flight of a step.
    """
    size = len(probability)
    centres = (np.arange(size) + 0.5) * cell_m
    east = centres - flights["east"][:, None, None]
    south = centres[:, None] - flights["south"][:, None, None]
    worth = probability * CLOSENESS ** (np.hypot(east, south) / legs_m[:, None, None])
    goals = np.full((len(flights), 2), size * cell_m / 2)
    # A cell without probability is none to fly to.
    worth[worth <= 0.0] = -1.0
    for drone, row, col in best_pairs(worth):
        goals[drone] = centres[col], centres[row]
    return goals

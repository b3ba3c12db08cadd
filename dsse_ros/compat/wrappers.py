# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The wrappers of `dsse_ros.search.environments.wrappers` under the names of DSSE 1.1.9."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.environments.wrappers import (
    ALL_POSITIONS,
    FLATTENED,
    IN_MATRIX,
    DiscountedObservations,
    EncodedObservations,
    RetainedPositions,
    SeenDiscount,
    top_cells,
)

__all__ = [
    "AllFlattenWrapper",
    "AllPositionsWrapper",
    "CommunicationWrapper",
    "MatrixEncodeWrapper",
    "RetainDronePosWrapper",
    "TopNProbsWrapper",
]


class AllPositionsWrapper(EncodedObservations):
    """Agents observe the cells of all drones, their own first, and the map."""

    def __init__(self, env: Any) -> None:
        super().__init__(env, ALL_POSITIONS)


class AllFlattenWrapper(EncodedObservations):
    """Agents observe one vector: the cells of all drones from 0 to 1, and the map."""

    def __init__(self, env: Any) -> None:
        super().__init__(env, FLATTENED)


class MatrixEncodeWrapper(EncodedObservations):
    """Agents observe the map with the drones drawn into it."""

    def __init__(self, env: Any) -> None:
        super().__init__(env, IN_MATRIX)


class TopNProbsWrapper(EncodedObservations):
    """Agents observe the cells of all drones, and the most probable cells."""

    def __init__(self, env: Any, n_positions: int = 10) -> None:
        super().__init__(env, top_cells(n_positions))
        self._count = n_positions

    @property
    def n_positions(self) -> int:
        """Number of the most probable cells; it can be set, and the spaces stay as they are."""
        return self._count

    @n_positions.setter
    def n_positions(self, count: int) -> None:
        self.encoding, self._count = top_cells(count), count


class CommunicationWrapper(DiscountedObservations):
    """Agents observe less probability where drones have been recently."""

    def __init__(self, env: Any, n_steps: int = 20) -> None:
        super().__init__(env, n_steps, all_seen=True)

    @property
    def n_steps(self) -> int:
        """Steps until a cell counts in full again; it can be set."""
        return self._seen.n_steps

    @n_steps.setter
    def n_steps(self, count: int) -> None:
        self._seen.n_steps = SeenDiscount(count).n_steps

    @property
    def passed_map(self) -> NDArray[np.float64]:
        """(G, G) float64, the step in which a drone was last in each cell; it can be set."""
        return self._seen.last_seen

    @passed_map.setter
    def passed_map(self, steps: Any) -> None:
        self._seen.last_seen[:] = steps


class RetainDronePosWrapper(RetainedPositions):
    """Every reset puts the drones into the same cells."""

    def __init__(self, env: Any, drone_positions: list[tuple[int, int]]) -> None:
        super().__init__(env, drone_positions)

    @property
    def drone_positions(self) -> Any:
        """Cells (x, y) of the drones at each reset; they can be set."""
        return self.drones_positions

    @drone_positions.setter
    def drone_positions(self, cells: Any) -> None:
        self.drones_positions = cells

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The wrappers of `dsse_ros.search.wrappers` under the names of DSSE 1.1.9."""

from __future__ import annotations

from typing import Any

from dsse_ros.search.wrappers import (
    ALL_POSITIONS,
    FLATTENED,
    IN_MATRIX,
    DiscountedObservations,
    EncodedObservations,
    RetainedPositions,
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
        """Number of the most probable cells."""
        return self._count


class CommunicationWrapper(DiscountedObservations):
    """Agents observe less probability where drones have been recently."""

    def __init__(self, env: Any, n_steps: int = 20) -> None:
        super().__init__(env, n_steps)

    @property
    def n_steps(self) -> int:
        """Steps until a cell counts in full again."""
        return self._seen.n_steps


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

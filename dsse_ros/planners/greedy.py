# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The greedy policy that the authors of DSSE published in 2024, made deterministic.

It sorts the N most probable cells in ascending order and assigns the i-th to drone i, which moves
towards it and searches there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.avoidance import approach
from dsse_ros.planners.masking import masked_moves
from dsse_ros.planners.planner import (
    Cell,
    DrawsNothing,
    Infos,
    Observations,
    cells_of,
    probability_of,
)
from dsse_ros.scenario.actions import ActionSet
from dsse_ros.scenario.probable_cells import most_probable


class Greedy(DrawsNothing):
    """Sends each drone to one of the cells that are the most probable now.

    A drone searches where it is if its next cell is another drone's present or already chosen
    cell. Drone i is the i-th live drone.

    Args:
        actions: Names of the actions by number.
        seed: Not used: the policy draws nothing.
        area: (G, G) bool [row, col], the cells to search; None for the whole grid.
        apart: Whether drones may be slow to leave their cells, see `masking.keep_apart`.

    Raises:
        ValueError: If search or a straight move is missing.
    """

    def __init__(
        self,
        actions: Sequence[str],
        *,
        seed: int = 0,
        area: NDArray[np.bool_] | None = None,
        apart: bool = False,
    ) -> None:
        self._actions = ActionSet(actions, area).with_moves()
        self._apart = apart

    def __call__(self, observations: Observations, infos: Infos) -> dict[str, int]:
        """Return an action number for every observed drone; see `Planner`."""
        if not observations:
            return {}
        present = cells_of(observations)
        goals = self._goals(present, probability_of(observations))
        ends = approach(self._actions, present, goals)
        cells = dict(zip(observations, present, strict=True))
        return masked_moves(cells, ends, infos, self._actions, apart=self._apart)

    def _goals(self, present: Sequence[Cell], probability: NDArray[np.float32]) -> list[Cell]:
        """Return the goal of each drone, among the cells that it can reach."""
        goals = list(present)
        for drones, component in self._actions.connected_components(present):
            reached = (
                probability if component is None else np.where(component, probability, -np.inf)
            )
            for drone, goal in zip(drones, most_probable(reached, len(drones)), strict=True):
                goals[drone] = goal
        return goals

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
from dsse_ros.world.scenario.actions import ActionSet, connected_components
from dsse_ros.world.scenario.probable_cells import most_probable
from dsse_ros.world.scenario.swarm import Swarm


class Greedy(DrawsNothing):
    """Sends each drone to one of the cells that are the most probable now.

    A drone searches where it is if its next cell is another drone's present or already chosen
    cell. Drone i is the i-th live drone.

    Args:
        swarm: What the drones can do.
        seed: Not used: the policy draws nothing.

    Raises:
        ValueError: If a straight move is missing.
    """

    def __init__(self, swarm: Swarm, *, seed: int = 0) -> None:
        self._swarm = swarm.with_moves()

    def __call__(self, observations: Observations, infos: Infos) -> dict[str, int]:
        """Return an action number for every observed drone; see `Planner`."""
        if not observations:
            return {}
        present = cells_of(observations)
        actions = self._swarm.actions_of(observations)
        goals = _goals(actions, present, probability_of(observations))
        ends = approach(actions, present, goals)
        cells = dict(zip(observations, present, strict=True))
        return masked_moves(cells, ends, infos, self._swarm)


def _goals(
    actions: Sequence[ActionSet], present: Sequence[Cell], probability: NDArray[np.float32]
) -> list[Cell]:
    """Return the goal of each drone, among the cells that it can reach."""
    goals = list(present)
    for drones, component in connected_components(actions, present):
        reached = probability if component is None else np.where(component, probability, -np.inf)
        for drone, goal in zip(drones, most_probable(reached, len(drones)), strict=True):
            goals[drone] = goal
    return goals

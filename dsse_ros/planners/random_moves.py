# SPDX-License-Identifier: Apache-2.0
"""Random actions: the floor that any planner has to beat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dsse_ros.planners.avoidance import settle
from dsse_ros.planners.planner import Observation, cells_of
from dsse_ros.search.rules import ACTION_VECTORS


class RandomMoves:
    """Draws uniformly among the actions that the mask allows.

    Drones whose draws would end in one cell do not all move: those that `settle` holds back
    search where they are.

    Args:
        actions: Legend of the action numbers; names that are no known action stay in the cell.
        seed: Of all draws.

    Raises:
        ValueError: If the legend lacks search.
    """

    def __init__(self, actions: Sequence[str], *, seed: int = 0) -> None:
        if "search" not in actions:
            raise ValueError(f"actions: search missing in {list(actions)!r}")
        self._search = list(actions).index("search")
        self._vectors = [ACTION_VECTORS.get(name, (0, 0)) for name in actions]
        self._rng = np.random.default_rng(seed)

    def __call__(
        self,
        observations: Mapping[str, Observation],
        infos: Mapping[str, Mapping[str, Any]],
    ) -> dict[str, int]:
        """Return an action number for every observed drone; see `Planner`."""
        draws = self._rng.random(len(observations))
        actions = []
        for agent, draw in zip(observations, draws, strict=True):
            allowed = np.flatnonzero(infos[agent]["action_mask"])
            actions.append(int(allowed[int(draw * allowed.size)]))
        present = cells_of(observations)
        wishes = [
            (col + self._vectors[action][0], row + self._vectors[action][1])
            for (col, row), action in zip(present, actions, strict=True)
        ]
        granted = settle(present, wishes)
        return {
            agent: action if wish == end else self._search
            for agent, action, wish, end in zip(observations, actions, wishes, granted, strict=True)
        }

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The cells from which the vehicles of B worlds look, where these may be elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.environments.snapshot import SnapshotError
from dsse_ros.search.step.viewpoints import NO_LOOK, VIEWPOINTS
from dsse_ros.world.scenario.rules import Rules


class Viewpoints:
    """The viewpoints of the vehicles in the last step.

    Args:
        shape: B and N.
        num_actions: Number of actions.

    Attributes:
        array: (B, N) of `viewpoints.VIEWPOINTS`.
    """

    def __init__(self, shape: tuple[int, ...], num_actions: int) -> None:
        self.array = np.zeros(shape, VIEWPOINTS)
        self._num_actions = num_actions

    @classmethod
    def of_rules(cls, rules: Rules, shape: tuple[int, ...]) -> Viewpoints | None:
        """Return the viewpoints of worlds (B, N); None if drones look in their own cells.

        In metres they look along their paths, and in the coverage task they do not look.
        """
        if not rules.vehicle_timed_actions or rules.in_metres or rules.covers:
            return None
        return cls(shape, len(rules.actions))

    def preset(self, viewpoints: NDArray[np.void]) -> None:
        """Set the viewpoints of the first world's vehicles for the next step.

        Args:
            viewpoints: (N,) of `VIEWPOINTS`; an unknown action means no look.
        """
        action = viewpoints["action"]
        known = (action >= 0) & (action < self._num_actions)
        self.array[0] = viewpoints
        self.array["action"][0] = np.where(known, action, NO_LOOK)
        self.array["preset"] = True

    def check(self, viewpoints: NDArray[np.void]) -> None:
        """Check viewpoints in a snapshot, an array of the same shape.

        Raises:
            SnapshotError: If an action does not exist.
        """
        action = viewpoints["action"]
        if not ((action >= NO_LOOK) & (action < self._num_actions)).all():
            raise SnapshotError("the snapshot is damaged: the look of a vehicle is not an action")

    def infos(self, world: int, drones: Sequence[int]) -> list[tuple[int, int, int]]:
        """Return the action, `NO_LOOK` for none, column and row of drones of a world."""
        return [
            (int(viewpoint["action"]), int(viewpoint["x"]), int(viewpoint["y"]))
            for viewpoint in self.array[world, drones]
        ]

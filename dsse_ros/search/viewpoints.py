# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which drones of B worlds look, and from where if their vehicles may be in other cells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.rules import Rules
from dsse_ros.search.snapshot import SnapshotError
from dsse_ros.step.viewpoints import NO_LOOK, VIEWPOINTS

if TYPE_CHECKING:
    from dsse_ros.search.world import World


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

    def give(self, viewpoints: NDArray[np.void]) -> None:
        """Set from where the vehicles of the first world look in the next step.

        Args:
            viewpoints: (N,) of `VIEWPOINTS`; an action that there is not is no look.
        """
        action = viewpoints["action"]
        known = (action >= 0) & (action < self._num_actions)
        self.array[0] = viewpoints
        self.array["action"][0] = np.where(known, action, NO_LOOK)
        self.array["preset"] = True

    def check(self, viewpoints: NDArray[np.void]) -> None:
        """Check viewpoints in a snapshot, an array of the same shape.

        Raises:
            SnapshotError: If a look is not one of an action.
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


def acting(world: World) -> NDArray[np.bool_]:
    """Return which drones (N,) of a world, a batch of one, act in the next step."""
    now, limit = world.worlds[0], world.scenario.timestep_limit
    acts = not now["done"] and now["t"] < world.rules.last_acting_step(limit)
    return world.drones["alive"][0] & np.bool_(acts)


def looks_done(
    world: World, actions: NDArray[Any]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the looks of the last step of a world, a batch of one, see `Looks.at`.

    Args:
        world: The world.
        actions: (N,) what its drones did, `HOLD` for nothing.
    """
    where = world.drones[0]
    if world.viewpoints is not None:
        where = world.viewpoints.array[0]
        actions = where["action"]
    return world.looks.at(actions, np.stack([where["x"], where["y"]], axis=1))

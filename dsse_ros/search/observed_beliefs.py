# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The beliefs that agents observe: they learn in the cells where drones say that they are."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.search.world import World
from dsse_ros.search.world_beliefs import WorldBeliefs


def observed_beliefs(world: World) -> WorldBeliefs:
    """Return the beliefs of B worlds as their agents can have them, see `WorldBeliefs`.

    Raises:
        FieldError: As there.
    """
    noisy = world.faults is not None and world.faults.is_noisy
    return _ObservedBeliefs(world) if noisy else WorldBeliefs(world)


class _SeenWorld:
    """A world whose drones are where they observed to be before the step."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.drones = world.drones.copy()

    def __getattr__(self, name: str) -> Any:
        if name == "_world":
            # It is being copied.
            raise AttributeError(name)
        return getattr(self._world, name)


class _ObservedBeliefs(WorldBeliefs):
    """Beliefs of worlds whose drones observe wrong positions."""

    _world: Any

    def __init__(self, world: World) -> None:
        self._truth = world
        super().__init__(_SeenWorld(world))  # type: ignore[arg-type]

    def before_step(self, actions: NDArray[np.int8]) -> None:
        """Note who is about to act, and where."""
        faults = self._truth.faults
        assert faults is not None
        self._world.drones[:] = self._truth.drones
        self._seen = faults.positions().copy()
        self._left = self._cells()
        super().before_step(actions)

    def _cells(self) -> NDArray[np.int64]:
        drones = self._truth.drones
        return np.stack([drones["x"], drones["y"]], axis=-1)

    def after_step(self, first: int = 0, last: int | None = None) -> None:
        """Learn from what was searched in the step of worlds first..last - 1, and move on."""
        drones, seen = self._world.drones[first:last], self._seen[first:last]
        drones[:] = self._truth.drones[first:last]
        # A move is known, where it began is not.
        moved = self._cells()[first:last] - self._left[first:last]
        drones["x"], drones["y"] = seen[..., 0] + moved[..., 0], seen[..., 1] + moved[..., 1]
        super().after_step(first, last)

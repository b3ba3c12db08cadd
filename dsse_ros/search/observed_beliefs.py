# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The beliefs that agents observe: updated in the cells that the drones report."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsse_ros.belief.look_kernels import Followed
from dsse_ros.search.world import World
from dsse_ros.search.world_beliefs import WorldBeliefs


def observed_beliefs(world: World) -> WorldBeliefs:
    """Return the beliefs of B worlds from what their agents observe, see `WorldBeliefs`.

    Raises:
        FieldError: As there.
    """
    noisy = world.faults is not None and world.faults.is_noisy
    return _ObservedBeliefs(world) if noisy else WorldBeliefs(world)


class _ObservedBeliefs(WorldBeliefs):
    """Beliefs of worlds whose drones observe noisy positions."""

    def __init__(self, world: World) -> None:
        self._drones = world.drones.copy()
        super().__init__(world)

    def before_step(self, actions: NDArray[np.int8]) -> None:
        """Record which drones are about to act, and where."""
        faults = self._world.faults
        assert faults is not None
        self._seen = faults.positions().copy()
        self._left = self._cells()
        super().before_step(actions)

    def _cells(self) -> NDArray[np.int64]:
        drones = self._world.drones
        return np.stack([drones["x"], drones["y"]], axis=-1)

    def after_step(self, first: int = 0, last: int | None = None) -> None:
        """Update worlds first..last - 1 with the searches of the step, and advance them."""
        drones, seen = self._drones[first:last], self._seen[first:last]
        drones[:] = self._world.drones[first:last]
        # A drone knows its move but not the cell in which the move began.
        moved = self._cells()[first:last] - self._left[first:last]
        drones["x"], drones["y"] = seen[..., 0] + moved[..., 0], seen[..., 1] + moved[..., 1]
        super().after_step(first, last)

    def _followed(self) -> Followed:
        followed = super()._followed()
        crew = followed.batch.crew._replace(drones=self._drones)
        return followed._replace(batch=followed.batch._replace(crew=crew))

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The belief of a world without a truth, in place of `WorldBeliefs`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.mission.live.live_search import Entry, LiveSearch
from dsse_ros.mission.live.records import from_text, to_text
from dsse_ros.mission.live.step_looks import StepLooks
from dsse_ros.search.belief.ensemble_belief import EnsembleBelief
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.search.environments.world import World
from dsse_ros.search.environments.world_beliefs import WorldBeliefs
from dsse_ros.search.step.constants import NO_ACTION

_KEPT = "belief_records"


class LiveBeliefs:
    """What a `LiveSearch` knows of one world; call `before_step` and `after_step` around each step.

    Args:
        world: A batch of one.

    Attributes:
        live_search: That of the present mission.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._acting = np.zeros(world.num_drones, np.bool_)
        self._actions = np.zeros(world.num_drones, np.int8)
        self.reset()

    def prepare(self) -> None:
        """Do nothing: the live search has made its forecast."""

    def reset(self, records: Iterable[StepLooks | Entry] = ()) -> None:
        """Start a new mission, with these records of its past."""
        self.live_search = LiveSearch(self._world.scenario, self._world.rules)
        self.live_search.update()
        self.live_search.repeat(records)

    @property
    def pos(self) -> NDArray[np.float64]:
        """(1,) cumulative probability of success."""
        return np.array([self.live_search.pos])

    @property
    def pos_alive(self) -> NDArray[np.float64] | None:
        """(1,) as `pos`, to find the person alive; None without a survival curve."""
        alive = self.live_search.pos_alive
        return None if alive is None else np.array([alive])

    def before_step(self, actions: NDArray[np.int8]) -> None:
        """Record which drones are about to act.

        Args:
            actions: (1, N) int8, the actions of the step.
        """
        self._actions[:] = actions[0]
        self._acting = self._world.acting()

    def after_step(self) -> None:
        """Update the belief with the looks of the step, and advance it."""
        self.live_search.step(self.looks())

    def looks(self) -> StepLooks:
        """Return the looks of the last step."""
        world = self._world
        actions = self._actions if world.faults is None else world.faults.applied[0]
        done = world.looks_done(np.where(self._acting, actions, NO_ACTION))
        if world.metres is None:
            return StepLooks(*done, np.zeros((0, 0, 2)), np.zeros((0, 0), bool), np.zeros(0, bool))
        none = np.zeros(0, np.int64)
        paths, looked = world.metres.paths[0].copy(), world.metres.looked[0].copy()
        return StepLooks(none, none, np.zeros((0, 2), np.int64), paths, looked, self._acting)

    def write(self) -> NDArray[np.float32]:
        """Return the probability of containment of every cell, (1, R, C) as [y, x]."""
        return np.minimum(self.live_search.belief.poc(), 1.0).astype(np.float32)[None]

    def of_ensemble(self, world: int) -> EnsembleBelief | None:
        """Return the belief; None if it is not of particles."""
        belief = self.live_search.belief
        return belief if isinstance(belief, EnsembleBelief) else None

    def end(self) -> None:
        """End the search of the world: everybody was found."""
        world, drones = self._world, self._world.drones[0]
        drones["terminated"] |= drones["alive"]
        drones["alive"] = False
        world.worlds["num_missing"] = world.worlds["num_active"] = 0
        world.worlds["done"] = True

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the state, to add to the world's state in a snapshot."""
        text = to_text(self.live_search.history).encode()
        return {_KEPT: np.frombuffer(text, np.uint8)}

    def check(self, snapshot: Snapshot) -> None:
        """Raise unless a snapshot has the records of a live search.

        Raises:
            SnapshotError: If it has none.
        """
        self._records(snapshot)

    def restore(self, snapshot: Snapshot) -> None:
        """Continue from a checked snapshot, after the world was restored from it."""
        self.reset(self._records(snapshot))

    def _records(self, snapshot: Snapshot) -> list[StepLooks | Entry]:
        """Return the records in a snapshot."""
        stored = snapshot.arrays.get(_KEPT, np.zeros(0, np.uint8))
        try:
            return from_text(stored.tobytes().decode())
        except ValueError as error:
            reason = str(error) if stored.size else "the snapshot is of a search with a truth"
            raise SnapshotError(reason) from None


def beliefs_of(world: World) -> WorldBeliefs | LiveBeliefs | None:
    """Return what follows a world, a batch of one; None if the task is coverage."""
    if world.coverage is not None:
        return None
    return WorldBeliefs(world) if world.scenario.has_persons else LiveBeliefs(world)

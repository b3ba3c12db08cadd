# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The beliefs of B worlds; each follows the steps and searches of its world."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.belief.belief_kernels import Mass
from dsse_ros.belief.ensemble_belief import EnsembleBelief
from dsse_ros.belief.follow_kernels import Beliefs
from dsse_ros.belief.followers import DRIFT_SAMPLES, EnsembleFollower, Follower, follower_of
from dsse_ros.belief.look_kernels import Followed
from dsse_ros.scenario.fields import FieldError
from dsse_ros.scenario.scenario import ResolvedScenario
from dsse_ros.search.snapshot import Snapshot, SnapshotError
from dsse_ros.search.world import World

__all__ = ["DRIFT_SAMPLES", "WorldBeliefs"]

_OF_PERSONS = ("pos", "missing", "unfound")


class WorldBeliefs:
    """The posterior of each world after its searches, as in `belief.Belief`.

    Call `before_step` and `after_step` around each step of the world.

    Args:
        world: The world to follow; its hidden state is never read.

    Attributes:
        pos: (B,) float64, cumulative probability of success of the searches of each mission.
        missing: (B, n) float64, see `belief.Belief`.
        unfound: (B, n) float64, see `belief.Belief`.
        masses: Where the persons of each world are; the arrays of a `Mass` with a first axis of B.

    Raises:
        FieldError: If the task is coverage, or if a forecast shared by a batch of worlds would be
            too large.
    """

    def __init__(self, world: World) -> None:
        if world.coverage is not None:
            raise FieldError(
                f"observe must be map with rules {world.rules.profile}, which have no persons, got "
                "'belief'"
            )
        self._world = world
        self._follower: Follower
        self._scenario: ResolvedScenario | None = None
        self.pos = np.zeros(world.num_worlds)
        self.missing, self.unfound = np.ones((2, world.num_worlds, world.scenario.person_amount))
        self._live = np.zeros(world.drones.shape, bool)
        self._done = np.zeros(world.num_worlds, bool)
        self._actions = np.zeros(world.drones.shape, np.int8)
        self.reset()

    def prepare(self) -> None:
        """Compute the persons' motion for a whole mission now, instead of in the first mission.

        If that is too large to keep, do nothing.
        """
        self._follower.prepare()

    def reset(self, which: NDArray[np.bool_] | None = None) -> None:
        """Start new missions with the last placed values of the worlds.

        Args:
            which: (B,) bool, the worlds; by default, and after new values were placed, all.

        Raises:
            FieldError: As the class; the beliefs stay as they are.
        """
        scenario = self._world.placed_scenario()
        if scenario != self._scenario:
            self._follower = follower_of(scenario, self._world.rules, self._world.num_worlds)
            self._scenario = scenario
            self._pods = np.ascontiguousarray(self._world.looks.pods[:, self._follower.examples])
            self.masses = Mass(
                *(
                    np.empty((self._world.num_worlds, *array.shape), array.dtype)
                    for array in self._follower.start
                )
            )
        worlds = slice(None) if which is None else which
        for array, start in zip(self.masses, self._follower.start, strict=True):
            array[worlds] = start
        self.missing[worlds] = self.unfound[worlds] = 1.0
        self.pos[worlds] = 0.0

    def step(self, actions: NDArray[np.int8]) -> None:
        """Advance every world by one step, see `World.step`, and update the beliefs."""
        self.before_step(actions)
        self._world.step(actions)
        self.after_step()

    def before_step(self, actions: NDArray[np.int8]) -> None:
        """Record which drones are about to act.

        Args:
            actions: (B, N) int8, the actions of the step.
        """
        self._actions[:] = actions
        self._live[:] = self._world.drones["alive"]
        self._done[:] = self._world.worlds["done"]

    def after_step(self, first: int = 0, last: int | None = None) -> None:
        """Update worlds first..last - 1 with the searches of the step, and advance them."""
        last = self._world.num_worlds if last is None else last
        # Faults can make drones deviate from commands; the actions that they did count.
        self._follower.follow(self._followed(), self._pods, self._beliefs(), first, last)

    def _followed(self) -> Followed:
        world = self._world
        actions = self._actions if world.faults is None else world.faults.applied
        return Followed(world.batch, actions, self._live, self._done)

    def _beliefs(self) -> Beliefs:
        return Beliefs(self.masses, self.missing, self.unfound, self.pos)

    def write(
        self, maps: NDArray[np.float32] | None = None, first: int = 0, last: int | None = None
    ) -> NDArray[np.float32]:
        """Write the probability of containment of every cell of worlds first..last - 1.

        Args:
            maps: (B, G, G) float32 out, as [y, x], by default new memory.
            first: Number of the first world.
            last: Number of the last world, plus one.

        Returns:
            The maps.
        """
        world, last = self._world, self._world.num_worlds if last is None else last
        if maps is None:
            maps = np.empty((world.num_worlds, world.grid_size, world.grid_size), np.float32)
        self._follower.write(self._followed(), self._beliefs(), maps, first, last)
        return maps

    def of_ensemble(self, world: int) -> EnsembleBelief | None:
        """Return the belief of a world; None if its persons do not follow an ensemble."""
        if not isinstance(self._follower, EnsembleFollower):
            return None
        step = int(self._world.worlds["t"][world])
        mass = Mass(*(array[world] for array in self.masses))
        return self._follower.belief(step, mass, self.missing[world])

    def _arrays(self) -> dict[str, NDArray[Any]]:
        """Return the state by the names that it has in a snapshot."""
        of_persons = {name: getattr(self, name) for name in _OF_PERSONS}
        arrays = {**self.masses._asdict(), **of_persons}
        return {f"belief_{name}": array for name, array in arrays.items()}

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the state, to add to the world's state in a snapshot."""
        return {name: array.copy() for name, array in self._arrays().items()}

    def check(self, snapshot: Snapshot) -> None:
        """Raise unless a snapshot has beliefs.

        Raises:
            SnapshotError: If it has none.
        """
        if "belief_layers" not in snapshot.arrays:
            raise SnapshotError("the snapshot is of a search without a belief")
        snapshot.check({}, {f"belief_{name}": getattr(self, name) for name in _OF_PERSONS})

    def restore(self, snapshot: Snapshot) -> None:
        """Continue from a checked snapshot, after the world was restored from it.

        Raises:
            SnapshotError: If the beliefs do not fit the world.
        """
        self.reset()
        arrays = self._arrays()
        snapshot.check({}, arrays)
        for name, array in arrays.items():
            array[:] = snapshot.arrays[name]

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The beliefs of B worlds; each follows the steps and searches of its world."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.search.belief.component_kernels import Mass
from dsse_ros.search.belief.ensemble_belief import EnsembleBelief
from dsse_ros.search.belief.filter_kernels import Beliefs
from dsse_ros.search.belief.filters import DRIFT_SAMPLES, BeliefFilter, ParticleFilter, filter_of
from dsse_ros.search.belief.look_kernels import StepDone
from dsse_ros.search.environments.snapshot import Snapshot, SnapshotError
from dsse_ros.search.environments.world import World
from dsse_ros.world.scenario.scenario import ResolvedScenario

__all__ = ["DRIFT_SAMPLES", "WorldBeliefs", "observed_beliefs"]

_PUBLISHED, _OF_POS, _OF_POS_ALIVE = "belief", "pos", "pos_alive"
"""The beliefs of a world, by what a snapshot calls them."""


class WorldBeliefs:
    """The posterior of each world after its searches, as in `belief.Belief`.

    Call `before_step` and `after_step` around each step of the world.

    POS has particles of its own, see `cell_tracks.Draw`.

    Args:
        world: The world to follow; its hidden state is never read.

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
        # What is published; of particles also what states the POS, and the POS alive.
        self._filtered: dict[str, tuple[BeliefFilter, Beliefs]] = {}
        self._scenario: ResolvedScenario | None = None
        self._live = np.zeros(world.drones.shape, bool)
        self._done = np.zeros(world.num_worlds, bool)
        self._actions = np.zeros(world.drones.shape, np.int8)
        self.reset()

    def prepare(self) -> None:
        """Compute the persons' motion for a whole mission now, instead of in the first mission.

        If that is too large to keep, do nothing.
        """
        for belief_filter, _ in self._filtered.values():
            belief_filter.prepare()

    @property
    def _filter(self) -> BeliefFilter:
        return self._filtered[_PUBLISHED][0]

    @property
    def masses(self) -> Mass:
        """Where the persons of each world are; a `Mass` whose arrays have a first axis of B."""
        return self._filtered[_PUBLISHED][1].masses

    @property
    def missing(self) -> NDArray[np.float64]:
        """(B, n) float64, see `belief.Belief`."""
        return self._filtered[_PUBLISHED][1].missing

    @property
    def unfound(self) -> NDArray[np.float64]:
        """(B, n) float64, see `belief.Belief`."""
        return self._of_pos.unfound

    @property
    def pos(self) -> NDArray[np.float64]:
        """(B,) float64, cumulative probability of success of the searches of each mission."""
        return self._of_pos.pos

    @property
    def pos_alive(self) -> NDArray[np.float64] | None:
        """(B,) float64, as `pos`, to find the person alive; None without a survival curve."""
        alive = self._filtered.get(_OF_POS_ALIVE)
        return None if alive is None else alive[1].pos

    @property
    def _of_pos(self) -> Beliefs:
        return self._filtered.get(_OF_POS, self._filtered[_PUBLISHED])[1]

    def reset(self, which: NDArray[np.bool_] | None = None) -> None:
        """Start new missions with the last placed values of the worlds.

        Args:
            which: (B,) bool, the worlds; by default, and after new values were placed, all.

        Raises:
            FieldError: As the class; the beliefs stay as they are.
        """
        scenario = self._world.placed_scenario()
        if scenario != self._scenario:
            published = filter_of(scenario, self._world.rules, self._world.num_worlds)
            filters = {_PUBLISHED: published}
            if (of_pos := published.of_pos()) is not published:
                filters[_OF_POS] = of_pos
            if isinstance(published, ParticleFilter) and (alive := published.of_pos_alive()):
                filters[_OF_POS_ALIVE] = alive
            self._filtered = {name: (each, self._new(each)) for name, each in filters.items()}
            self._scenario = scenario
            self._pods = np.ascontiguousarray(self._world.looks.pods[:, published.pod_columns])
        worlds = slice(None) if which is None else which
        for belief_filter, beliefs in self._filtered.values():
            for array, start in zip(beliefs.masses, belief_filter.start, strict=True):
                array[worlds] = start
            beliefs.missing[worlds] = beliefs.unfound[worlds] = 1.0
            beliefs.pos[worlds] = 0.0

    def _new(self, belief_filter: BeliefFilter) -> Beliefs:
        """Return memory for the beliefs of a filter."""
        count, persons = self._world.num_worlds, len(belief_filter.class_of)
        masses = Mass(*(np.empty((count, *a.shape), a.dtype) for a in belief_filter.start))
        missing, unfound = np.ones((2, count, persons))
        return Beliefs(masses, missing, unfound, np.zeros(count))

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
        step = self._step_done()
        for belief_filter, beliefs in self._filtered.values():
            belief_filter.update(step, self._pods, beliefs, first, last)

    def _step_done(self) -> StepDone:
        world = self._world
        actions = self._actions if world.faults is None else world.faults.applied
        return StepDone(world.batch, actions, self._live, self._done)

    def write(
        self, maps: NDArray[np.float32] | None = None, first: int = 0, last: int | None = None
    ) -> NDArray[np.float32]:
        """Write the probability of containment of every cell of worlds first..last - 1.

        Args:
            maps: (B, R, C) float32 out, as [y, x], by default new memory.
            first: Number of the first world.
            last: Number of the last world, plus one.

        Returns:
            The maps.
        """
        world, last = self._world, self._world.num_worlds if last is None else last
        if maps is None:
            maps = np.empty((world.num_worlds, *world.grid_size.matrix), np.float32)
        belief_filter, beliefs = self._filtered[_PUBLISHED]
        belief_filter.write(self._step_done(), beliefs, maps, first, last)
        return maps

    def of_ensemble(self, world: int) -> EnsembleBelief | None:
        """Return the belief of a world; None if its persons do not follow an ensemble."""
        if not isinstance(self._filter, ParticleFilter):
            return None
        step = int(self._world.worlds["t"][world])
        mass = Mass(*(array[world] for array in self.masses))
        return self._filter.belief(step, mass, self.missing[world])

    def _arrays(self) -> dict[str, NDArray[Any]]:
        """Return the state by the names that it has in a snapshot."""
        masses = {
            f"{purpose}_{name}": array
            for purpose, (_, beliefs) in self._filtered.items()
            for name, array in beliefs.masses._asdict().items()
        }
        return masses | self._of_persons()

    def _of_persons(self) -> dict[str, NDArray[Any]]:
        """Return what is known of the persons, as in `_arrays`."""
        return {
            f"{purpose}_{name}": getattr(beliefs, name)
            for purpose, (_, beliefs) in self._filtered.items()
            for name in ("pos", "missing", "unfound")
        }

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the state, to add to the world's state in a snapshot."""
        return {name: array.copy() for name, array in self._arrays().items()}

    def check(self, snapshot: Snapshot) -> None:
        """Raise unless a snapshot has beliefs.

        Raises:
            SnapshotError: If it has none.
        """
        if "belief_components" not in snapshot.arrays:
            raise SnapshotError("the snapshot is of a search without a belief")
        snapshot.check({}, self._of_persons())

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

    def _step_done(self) -> StepDone:
        done = super()._step_done()
        entities = done.batch.entities._replace(drones=self._drones)
        return done._replace(batch=done.batch._replace(entities=entities))

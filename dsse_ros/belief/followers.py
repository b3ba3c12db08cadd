# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Update of the beliefs of many worlds of one scenario, for motions and for ensembles."""

from __future__ import annotations

from collections import deque
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dsse_ros.belief import (
    follow_kernels,
    layer_kernels,
    particle_kernels,
    passing_kernels,
)
from dsse_ros.belief.belief import Belief, Forecast
from dsse_ros.belief.belief_kernels import Mass
from dsse_ros.belief.ensemble_belief import EnsembleBelief, EnsembleForecast
from dsse_ros.belief.follow_kernels import Beliefs, FollowScratch, Tables
from dsse_ros.belief.forecasts import is_ensemble
from dsse_ros.belief.look_kernels import Followed
from dsse_ros.belief.particle_kernels import ParticleTables
from dsse_ros.belief.passing_kernels import PassingTables, seen_of
from dsse_ros.belief.search_outcomes import OF_CLASS
from dsse_ros.compiled.overloads import Specialized
from dsse_ros.scenario.fields import FieldError
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import ResolvedScenario

DRIFT_SAMPLES = 64
"""Angles of a person's own drift: with 64, the POS is within .006 of the POS with 1024."""


class Follower(Protocol):
    """Advances and writes the beliefs of B worlds; threads may share it.

    Attributes:
        start: The belief at a mission's first observation.
        class_of: (n,) int64, the detection class of each person.
        examples: (C,) int64, number of a person of each class.
    """

    start: Mass
    class_of: NDArray[np.int64]
    examples: NDArray[np.int64]

    def follow(
        self, followed: Followed, pods: NDArray[np.float64], beliefs: Beliefs, first: int, last: int
    ) -> None:
        """Update worlds first..last - 1 with the looks of the step, and advance them.

        Args:
            followed: The worlds, after the step.
            pods: (L, C) float64, POD of each look by detection class.
            beliefs: The beliefs of the worlds, in and out.
            first: Number of the first world.
            last: Number of the last world, plus one.
        """
        ...

    def write(
        self, followed: Followed, beliefs: Beliefs, maps: NDArray[np.float32], first: int, last: int
    ) -> None:
        """Write the probability of every cell of worlds first..last - 1 to maps (B, G, G)."""
        ...

    def prepare(self) -> None:
        """Compute the tables of a whole mission now, instead of in the first mission."""
        ...


def follower_of(scenario: ResolvedScenario, rules: Rules, num_worlds: int) -> Follower:
    """Return the follower for B worlds of a scenario.

    Raises:
        FieldError: If a forecast shared by a batch of worlds would be too large.
    """
    if rules.in_metres:
        return FlightFollower(scenario, rules)
    if is_ensemble(rules):
        return EnsembleFollower(scenario, rules)
    return MotionFollower(scenario, rules, num_worlds)


def _scratch(follower: Follower, followed: Followed, motion: NDArray[np.float64]) -> FollowScratch:
    """Return memory for a thread; `motion` is that of `FollowScratch`."""
    crew = followed.batch.crew
    most = crew.drones.shape[1] * int(np.diff(crew.looks, axis=1).max(initial=0))
    return FollowScratch(
        np.empty((OF_CLASS, len(follower.examples))), np.empty(len(follower.class_of)),
        np.empty((most, 2), np.int64), np.empty(most, np.int64), motion,
    )  # fmt: skip


class MotionFollower:
    """Follows worlds whose persons move step by step; a `Follower`.

    Args:
        scenario: What is searched.
        rules: The rules of the search.
        num_worlds: B.

    Raises:
        FieldError: As `follower_of`.
    """

    def __init__(self, scenario: ResolvedScenario, rules: Rules, num_worlds: int) -> None:
        self._scenario = scenario
        self._rules = rules
        self._num_worlds = num_worlds
        self._follow = Specialized(follow_kernels.follow_worlds)
        self._write = Specialized(follow_kernels.write_beliefs)
        belief = Belief(forecast := self._new_forecast())
        # One forecast per thread: another thread would change its tables during a read.
        self._forecasts = deque([forecast])
        self.start = belief.mass
        self.class_of, self.examples = belief.class_of, belief.examples

    def __getstate__(self) -> dict[str, object]:
        # Forecasts are large, so copies make them again at the first use.
        return {**vars(self), "_forecasts": deque()}

    def _new_forecast(self) -> Forecast:
        scenario, rules = self._scenario, self._rules
        forecast = Forecast(scenario, rules, drift_samples=DRIFT_SAMPLES)
        steps = forecast.first_step + rules.last_step(scenario.timestep_limit)
        if self._num_worlds > 1 and len(forecast.steps.directions) <= steps:
            raise FieldError(
                f"grid_size must be smaller, or the steps fewer, with beliefs for "
                f"{self._num_worlds} worlds and {scenario.timestep_limit} steps, "
                f"got {scenario.grid_size}"
            )
        return forecast

    def prepare(self) -> None:
        """Compute the persons' motion for a whole mission, if that is not too large to keep."""
        forecast = self._take_forecast()
        steps = self._rules.last_step(self._scenario.timestep_limit)
        if len(forecast.steps.directions) > forecast.first_step + steps:
            belief = Belief(forecast)
            for _ in range(steps):
                belief.advance()
        self._forecasts.append(forecast)

    def _take_forecast(self) -> Forecast:
        """Return a forecast that no other thread has; append it to `_forecasts` after use."""
        try:
            return self._forecasts.popleft()
        except IndexError:
            return self._new_forecast()

    def follow(
        self, followed: Followed, pods: NDArray[np.float64], beliefs: Beliefs, first: int, last: int
    ) -> None:
        """See `Follower`."""
        forecast = self._take_forecast()
        # A world that was just reset is at step 0.
        steps = max(int(followed.batch.worlds["t"][first:last].max()) - 1, 0)
        forecast.look(forecast.first_step + steps)
        tables = Tables(
            self.start, pods, self.class_of, forecast.sea, forecast.steps, forecast.first_step
        )
        scratch = _scratch(self, followed, layer_kernels.new_scratch(self.start.layers.shape[1]))
        self._follow(followed, tables, beliefs, scratch, first, last)
        self._forecasts.append(forecast)

    def write(
        self, followed: Followed, beliefs: Beliefs, maps: NDArray[np.float32], first: int, last: int
    ) -> None:
        """See `Follower`."""
        scratch = np.empty(len(self.examples) + maps.shape[-1])
        self._write(followed.batch.constants, beliefs, self.class_of, scratch, maps, first, last)


class EnsembleFollower:
    """Follows worlds whose persons follow an ensemble; a `Follower`.

    Args:
        scenario: What is searched.
        rules: The rules of the search.
    """

    def __init__(self, scenario: ResolvedScenario, rules: Rules) -> None:
        self._made_of = scenario, rules
        belief = EnsembleBelief(EnsembleForecast(scenario, rules))
        self._forecast = belief.forecast
        self._follow = Specialized(particle_kernels.follow_particles)
        self._write = Specialized(particle_kernels.write_particles)
        self.start = belief.mass
        self.class_of, self.examples = belief.class_of, belief.examples

    def __reduce__(self) -> tuple[object, ...]:
        # Particles are large and follow from the scenario, so copies share them.
        return type(self), self._made_of

    def prepare(self) -> None:
        """Do nothing: the particles are already complete."""

    def belief(self, step: int, mass: Mass, missing: NDArray[np.float64]) -> EnsembleBelief:
        """Return the belief of a world.

        Args:
            step: Steps done in its mission.
            mass: Of the world; the belief gets a copy.
            missing: (n,) float64, see `WorldBeliefs`.
        """
        belief = self._forecast.belief()
        belief.step, belief.mass = step, mass.copy()
        belief.missing[:] = missing
        return belief

    def follow(
        self, followed: Followed, pods: NDArray[np.float64], beliefs: Beliefs, first: int, last: int
    ) -> None:
        """See `Follower`."""
        scratch = _scratch(self, followed, np.empty(0))
        self._follow(followed, self._tables(pods), beliefs, scratch, first, last)

    def write(
        self, followed: Followed, beliefs: Beliefs, maps: NDArray[np.float32], first: int, last: int
    ) -> None:
        """See `Follower`."""
        tables = self._tables(np.empty((0, len(self.examples))))
        scale = np.empty(len(self.examples))
        constants, worlds, *_ = followed.batch
        self._write(constants, worlds, tables, beliefs, scale, maps, first, last)

    def _tables(self, pods: NDArray[np.float64]) -> ParticleTables:
        particles = self._forecast.particles()
        first_step = self._forecast.first_step
        return ParticleTables(self.start, particles, pods, self.class_of, first_step)


class FlightFollower(EnsembleFollower):
    """Follows worlds whose drones fly in metres; a `Follower`."""

    def __init__(self, scenario: ResolvedScenario, rules: Rules) -> None:
        super().__init__(scenario, rules)
        self._follow = Specialized(passing_kernels.follow_paths)

    def follow(
        self, followed: Followed, pods: NDArray[np.float64], beliefs: Beliefs, first: int, last: int
    ) -> None:
        """See `Follower`."""
        places = self._forecast.places(self.examples)
        tables = PassingTables(self.start, places, self.class_of, self._forecast.first_step)
        seen = seen_of(places, followed.live.shape[1])
        scratch = _scratch(self, followed, np.empty(0))
        self._follow(followed, tables, beliefs, scratch, seen, first, last)

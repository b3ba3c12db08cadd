# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The filters that update the beliefs of many worlds of one scenario, in cells and by particles."""

from __future__ import annotations

from collections import deque
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.overloads import Specialized
from dsse_ros.base.fields import FieldError
from dsse_ros.search.belief import (
    component_motion,
    filter_kernels,
    particle_kernels,
    passing_kernels,
)
from dsse_ros.search.belief.belief import Belief, Forecast
from dsse_ros.search.belief.component_kernels import Mass
from dsse_ros.search.belief.ensemble_belief import EnsembleBelief, EnsembleForecast
from dsse_ros.search.belief.filter_kernels import Beliefs, FilterScratch, Tables
from dsse_ros.search.belief.forecasts import is_ensemble
from dsse_ros.search.belief.look_kernels import StepDone
from dsse_ros.search.belief.particle_kernels import ParticleTables
from dsse_ros.search.belief.passing_kernels import PassingTables, seen_of
from dsse_ros.search.belief.search_outcomes import OF_CLASS
from dsse_ros.search.step.cell_tracks import Draw
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario

DRIFT_SAMPLES = 64
"""Angles of a person's own drift: with 64, the POS is within .006 of the POS with 1024."""


class GridFilter:
    """Updates the beliefs of B worlds whose persons move from cell to cell.

    Threads may share it.

    Args:
        scenario: What is searched.
        rules: The rules of the search.
        num_worlds: B.

    Attributes:
        start: The belief at a mission's first observation.
        class_of: (n,) int64, the detection class of each person.
        examples: (C,) int64, number of a person of each class.
        pod_columns: See `BeliefBase`.

    Raises:
        FieldError: If a forecast shared by a batch of worlds would be too large.
    """

    def __init__(self, scenario: ResolvedScenario, rules: Rules, num_worlds: int) -> None:
        self._scenario = scenario
        self._rules = rules
        self._num_worlds = num_worlds
        self._update = Specialized(filter_kernels.filter_worlds)
        self._write = Specialized(filter_kernels.write_beliefs)
        belief = Belief(forecast := self._new_forecast())
        # One forecast per thread: another thread would change its tables during a read.
        self._forecasts = deque([forecast])
        self.start = belief.mass
        self.class_of, self.examples = belief.class_of, belief.examples
        self.pod_columns = belief.pod_columns

    def __getstate__(self) -> dict[str, object]:
        # Forecasts are large, so copies make them again at the first use.
        return {**vars(self), "_forecasts": deque()}

    def _new_forecast(self) -> Forecast:
        scenario, rules = self._scenario, self._rules
        forecast = Forecast(scenario, rules, drift_samples=DRIFT_SAMPLES)
        steps = forecast.first_step + rules.last_step(scenario.timestep_limit)
        if self._num_worlds > 1 and len(forecast.moves.directions) <= steps:
            raise FieldError(
                f"grid_size must be smaller, or the steps fewer, with beliefs for "
                f"{self._num_worlds} worlds and {scenario.timestep_limit} steps, "
                f"got {scenario.grid_size}"
            )
        return forecast

    def of_pos(self) -> GridFilter:
        """Return the filter of the beliefs that state the POS: this one, which is exact."""
        return self

    def prepare(self) -> None:
        """Compute the persons' motion for a whole mission now, if that is not too large to keep."""
        forecast = self._take_forecast()
        steps = self._rules.last_step(self._scenario.timestep_limit)
        if len(forecast.moves.directions) > forecast.first_step + steps:
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

    def update(
        self, step: StepDone, pods: NDArray[np.float64], beliefs: Beliefs, first: int, last: int
    ) -> None:
        """Update worlds first..last - 1 with the looks of a step, and advance them.

        Args:
            step: The step.
            pods: (L, C) float64, POD of each look by detection class.
            beliefs: The beliefs of the worlds, in and out.
            first: Number of the first world.
            last: Number of the last world, plus one.
        """
        forecast = self._take_forecast()
        # A world that was just reset is at step 0.
        steps = max(int(step.batch.worlds["t"][first:last].max()) - 1, 0)
        forecast.prepare(forecast.first_step + steps)
        tables = Tables(
            start=self.start,
            pods=pods,
            class_of=self.class_of,
            sea=forecast.sea,
            moves=forecast.moves,
            first_step=forecast.first_step,
        )
        scratch = _scratch(self, step, component_motion.new_scratch(self.start.components.shape[1]))
        self._update(step, tables, beliefs, scratch, first, last)
        self._forecasts.append(forecast)

    def write(
        self, step: StepDone, beliefs: Beliefs, maps: NDArray[np.float32], first: int, last: int
    ) -> None:
        """Write the probability of every cell of worlds first..last - 1 to maps (B, R, C)."""
        scratch = np.empty(len(self.examples) + maps.shape[-1])
        self._write(step.batch.constants, beliefs, self.class_of, scratch, maps, first, last)


class ParticleFilter:
    """Updates the beliefs of B worlds whose persons follow an ensemble; see `GridFilter`.

    In cells drones look at cells, and in metres they pass particles.

    Args:
        scenario: What is searched.
        rules: The rules of the search.
        draw: What the particles are drawn for.
        living: See `EnsembleForecast`.
    """

    def __init__(
        self, scenario: ResolvedScenario, rules: Rules, draw: Draw = Draw.BELIEF,
        living: bool = False,
    ) -> None:  # fmt: skip
        self._made_of = scenario, rules, draw, living
        belief = EnsembleBelief(EnsembleForecast(scenario, rules, draw=draw, living=living))
        self._forecast, self._in_metres = belief.forecast, rules.in_metres
        self._update = Specialized(
            passing_kernels.filter_paths if rules.in_metres else particle_kernels.filter_particles
        )
        self._write = Specialized(particle_kernels.write_particles)
        self.start = belief.mass
        self.class_of, self.examples = belief.class_of, belief.examples
        self.pod_columns = belief.pod_columns

    def __reduce__(self) -> tuple[object, ...]:
        # Particles are large and follow from the scenario, so copies share them.
        return type(self), self._made_of

    def of_pos(self) -> ParticleFilter:
        """Return the filter of the beliefs that state the POS, with particles of its own."""
        scenario, rules, *_ = self._made_of
        return ParticleFilter(scenario, rules, Draw.POS)

    def of_pos_alive(self) -> ParticleFilter | None:
        """As `of_pos`, for the POS alive; None without a survival curve."""
        scenario, rules, *_ = self._made_of
        if self._forecast.tracks.dies is None:
            return None
        return ParticleFilter(scenario, rules, Draw.POS, living=True)

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

    def update(
        self, step: StepDone, pods: NDArray[np.float64], beliefs: Beliefs, first: int, last: int
    ) -> None:
        """Update worlds first..last - 1 with the looks of a step; see `GridFilter.update`."""
        if self._in_metres:
            places = self._forecast.places(self.examples)
            tables: Any = PassingTables(
                self.start, places, self.class_of, self._forecast.first_step
            )
            scratch = _scratch(self, step, seen_of(places, step.live.shape[1]))
        else:
            tables = self._tables(pods, step, first, last)
            scratch = _scratch(self, step, np.empty(0))
        self._update(step, tables, beliefs, scratch, first, last)

    def write(
        self, step: StepDone, beliefs: Beliefs, maps: NDArray[np.float32], first: int, last: int
    ) -> None:
        """Write the probability of every cell of worlds first..last - 1 to maps (B, R, C)."""
        tables = self._tables(np.empty((0, len(self.examples))), step, first, last)
        scale = np.empty(len(self.examples))
        constants, worlds, *_ = step.batch
        self._write(constants, worlds, tables, beliefs, scale, maps, first, last)

    def _tables(
        self, pods: NDArray[np.float64], step: StepDone, first: int, last: int
    ) -> ParticleTables:
        """Return the tables for worlds first..last - 1, with the particles at their steps."""
        forecast, done = self._forecast, step.batch.worlds["t"][first:last]
        # The update is that of the step before.
        begin = forecast.row(max(forecast.first_step + int(done.min()) - 1, 0))
        end = forecast.row(forecast.first_step + int(done.max()))
        return ParticleTables(
            start=self.start, particles=forecast.particles(begin, end), pods=pods,
            class_of=self.class_of, first_step=forecast.first_step - begin,
        )  # fmt: skip


BeliefFilter: TypeAlias = GridFilter | ParticleFilter


def filter_of(scenario: ResolvedScenario, rules: Rules, num_worlds: int) -> BeliefFilter:
    """Return the filter for B worlds of a scenario.

    Raises:
        FieldError: As `GridFilter`.
    """
    if is_ensemble(rules):
        return ParticleFilter(scenario, rules)
    return GridFilter(scenario, rules, num_worlds)


def _scratch(belief_filter: BeliefFilter, step: StepDone, own: Any) -> FilterScratch:
    """Return memory for a thread; `own` is that of `FilterScratch`."""
    entities = step.batch.entities
    most = entities.drones.shape[1] * int(np.diff(entities.look_starts, axis=1).max(initial=0))
    return FilterScratch(
        numbers=np.empty((OF_CLASS, len(belief_filter.examples))),
        hazard=np.empty(len(belief_filter.class_of)), seen=np.empty((most, 2), np.int64),
        rows=np.empty(most, np.int64), own=own,
    )  # fmt: skip

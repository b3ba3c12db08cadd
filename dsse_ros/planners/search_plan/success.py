# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The POS of searches, on particles that move: what a belief states once they are flown."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.search_plan.assignments import Assignment
from dsse_ros.planners.search_plan.timed_tracks import TrackSearch
from dsse_ros.search.belief import passing_kernels
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.search.step.metres_detection import detectors_of

Floats = NDArray[np.float64]


class Success:
    """How likely searches find the persons of a forecast.

    Args:
        forecast: The particles.
        every: Steps in which the particles are taken to drift straight.
    """

    def __init__(self, forecast: EnsembleForecast, *, every: int = 1) -> None:
        self._forecast, self._every = forecast, every
        multipliers = np.array(forecast.scenario.person_pod_multipliers)
        _, examples, of_person = np.unique(multipliers, return_index=True, return_inverse=True)
        self._shares = np.bincount(of_person.ravel()) / len(multipliers)
        self._places = forecast.places(examples)
        self._step_s = forecast.scenario.step_duration_s
        grid, area = forecast.scenario.grid_size, forecast.area
        self._area = np.ones(grid.matrix, np.bool_) if area is None else np.array(area)

    @property
    def certain(self) -> Floats:
        """The probability that nobody who searches misses a person, (C, M) ones."""
        return np.ones((len(self._shares), len(self._forecast.weights)))

    def missed(self, search: TrackSearch) -> Floats:
        """Return the probability that a search misses a person, (C, M) by class.

        What it does before the mission begins is left out: nobody knows the particles then.
        """
        out = self.certain
        track, _, goes_on = search.between(0.0, math.inf)
        if not len(track.times_s):
            return out
        period = self._every * self._step_s
        begins, ends = float(track.times_s[0]), float(track.times_s[-1])
        between = np.arange(int(begins // period) + 1, math.ceil(ends / period)) * period
        times = np.unique(np.concatenate([track.times_s, between]))
        passing_kernels.multiply_missed(
            detectors_of([search.lateral], self._step_s), track.places_at(times),
            self._forecast.first_step + times / self._step_s, self._places, self._area,
            self._step_s, np.array([goes_on, True]), out,
        )  # fmt: skip
        return out

    def pos(self, missed: Iterable[Floats]) -> float:
        """Return the POS of searches that miss with these probabilities; see `missed`."""
        left = np.prod(list(missed), axis=0)
        # The order of a sum must not depend on the machine's libraries.
        return float((self.mean_found(left) * self._forecast.weights).sum())

    def mean_found(self, missed: Floats) -> Floats:
        """Return the mean probability over the persons that they are not missed, (M,)."""
        found: Floats = 1.0 - (self._shares[:, None] * missed).sum(axis=0)
        return found

    def share_in(self, assignment: Assignment, found: Floats | None = None) -> float:
        """Return the probability of containment of an area in the middle of its search.

        Args:
            assignment: The assignment.
            found: (M,) factor on each particle; None for 1.
        """
        positions = self._forecast.tracks.particles_m
        assert positions is not None
        step = (assignment.commences_s + assignment.ends_s) / 2 / self._step_s
        row = self._forecast.row(self._forecast.first_step + int(step))
        inside = assignment.area.contains(positions[row])
        weights = self._forecast.weights if found is None else self._forecast.weights * found
        return float(weights[inside].sum())

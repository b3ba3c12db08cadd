# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search plan in a mission: drones that fly its tracks, and what all its units search."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.search_plan.plan_file import PlannedUnit
from dsse_ros.planners.search_plan.success import Success
from dsse_ros.planners.search_plan.timed_tracks import TrackSearch
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast

Floats = NDArray[np.float64]


class PlanInMission:
    """The units of a plan, in a mission of N drones.

    Args:
        units: The units.
        forecast: The particles of a belief.

    Attributes:
        ways: Where each drone that flies a unit is when, by its number.
    """

    def __init__(self, units: Sequence[PlannedUnit], forecast: EnsembleForecast) -> None:
        self._success, self._units = Success(forecast), units
        self._until_s = forecast.scenario.timestep_limit * forecast.scenario.step_duration_s
        by_number = [(unit.drone(forecast.scenario.num_drones), unit) for unit in units]
        self.ways = {number: unit.way for number, unit in by_number if number is not None}
        self._others = [unit.search for number, unit in by_number if number is None]

    def missed_by_others(self, begins_s: float, ends_s: float) -> Floats:
        """Return the probability that units which no drone flies miss a person, (C, M) by class."""
        return self._missed(self._others, begins_s, ends_s)

    def left(self, begins_s: float) -> Floats:
        """Return the probability that no unit finds a person from a time on, (M,)."""
        searches = [unit.search for unit in self._units]
        missed = self._missed(searches, begins_s, self._until_s)
        left: Floats = 1.0 - self._success.mean_found(missed)
        return left

    def _missed(self, searches: Iterable[TrackSearch], begins_s: float, ends_s: float) -> Floats:
        parts = [self._success.missed(search.between(begins_s, ends_s)) for search in searches]
        missed: Floats = np.prod([self._success.certain, *parts], axis=0)
        return missed

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search plan, and how likely it finds the persons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from dsse_ros.planners.search_plan.assignments import Assignment
from dsse_ros.planners.search_plan.plan_file import begins_s
from dsse_ros.planners.search_plan.success import Success
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.world.drift.flow import utc
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import search_to_geodetic
from dsse_ros.world.scenario.scenario import ResolvedScenario, scenario_frame


class AreaSuccess(NamedTuple):
    """How likely an area holds the persons, and its unit finds them.

    Attributes:
        poc: Probability of containment of the area in the middle of its search.
        pod: Probability that its unit detects a person who is there then.
        pos: Probability that its unit alone finds a person, wherever he or she is.
    """

    poc: float
    pod: float
    pos: float


@dataclass(frozen=True, eq=False)
class SearchPlan:
    """A plan.

    Attributes:
        forecast: The persons; their particles are those of the POS, which no planner has seen.
        assignments: What each unit does.
        areas: How likely each finds the persons.
        pos: How likely all of them together do.
        pos_before: How likely earlier searches have found the persons; the other probabilities are
            those if they have not.
    """

    forecast: EnsembleForecast
    assignments: tuple[Assignment, ...]
    areas: tuple[AreaSuccess, ...]
    pos: float
    pos_before: float = 0.0

    @property
    def pos_cumulative(self) -> float:
        """How likely the earlier searches and this one find the persons."""
        return 1.0 - (1.0 - self.pos_before) * (1.0 - self.pos)

    @property
    def scenario(self) -> ResolvedScenario:
        """The scenario."""
        return self.forecast.scenario

    @property
    def frame(self) -> GridFrame:
        """Where the grid lies."""
        return scenario_frame(self.scenario)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each area."""
        return tuple(f"A-{number}" for number in range(1, len(self.assignments) + 1))

    def place(self, east: float, south: float) -> tuple[float, float]:
        """Return latitude and longitude of a point of the plan."""
        lat, lon = search_to_geodetic(self.frame, float(east), float(south))
        return float(lat), float(lon)

    def date_s(self, time_s: float) -> float:
        """Return a time of the plan in seconds since 1970-01-01 UTC."""
        return begins_s(self.scenario) + time_s

    def clock(self, time_s: float) -> str:
        """Return a time of the plan, ISO 8601 in UTC."""
        return utc(round(self.date_s(time_s)))


def stated_plan(
    forecast: EnsembleForecast, assignments: Sequence[Assignment], pos_before: float = 0.0
) -> SearchPlan:
    """Return assignments with how likely they find the persons.

    Args:
        forecast: The persons.
        assignments: What each unit does.
        pos_before: See `SearchPlan`.
    """
    success = Success(forecast.of_pos)
    missed = [success.missed(assignment.search) for assignment in assignments]
    areas = []
    for assignment, left in zip(assignments, missed, strict=True):
        poc = success.share_in(assignment)
        found = success.share_in(assignment, success.mean_found(left))
        areas.append(AreaSuccess(poc, found / poc if poc > 0 else 0.0, success.pos([left])))
    return SearchPlan(
        forecast.of_pos, tuple(assignments), tuple(areas), success.pos(missed), pos_before
    )

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The searches of a plan's units as inputs of a live search, once they are over."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dsse_ros.mission.live.inputs import DEFINITE_RANGE, INVERSE_CUBE
from dsse_ros.planners.search_plan.plan_file import PlannedUnit, begins_s
from dsse_ros.world.drift.flow import utc
from dsse_ros.world.scenario.geodesy import search_to_geodetic
from dsse_ros.world.scenario.scenario import ResolvedScenario, scenario_frame


class PlannedSearches:
    """What units of a plan search that no drone of a search flies.

    Args:
        units: The units.
        scenario: The scenario.
    """

    def __init__(self, units: Sequence[PlannedUnit], scenario: ResolvedScenario) -> None:
        self._scenario = scenario
        others = (unit for unit in units if unit.drone(scenario.num_drones) is None)
        # What was searched before the search began is no input of it.
        self._left = [unit for unit in others if unit.search.track.times_s[0] >= 0]

    def over(self, time_s: float) -> list[dict[str, Any]]:
        """Return those that end by a time, as the fields of `live/searched`; each once."""
        over = [unit for unit in self._left if unit.search.track.times_s[-1] <= time_s]
        self._left = [unit for unit in self._left if unit not in over]
        return [self._input(unit) for unit in over]

    def _input(self, unit: PlannedUnit) -> dict[str, Any]:
        (points, times), lateral = unit.search.track, unit.search.lateral
        frame, begins = scenario_frame(self._scenario), begins_s(self._scenario)
        lats, lons = search_to_geodetic(frame, points[:, 0], points[:, 1])
        line = [[float(lon), float(lat)] for lat, lon in zip(lats, lons, strict=True)]
        seen = {"sweep_width": 2 * lateral.reach_m, "pod": lateral.pod, "law": DEFINITE_RANGE}
        if lateral.sweep_width_m:
            seen = {"sweep_width": lateral.sweep_width_m, "law": INVERSE_CUBE}
        first, last = (utc(begins + float(at)) for at in times[[0, -1]])
        return {
            "id": f"plan: {unit.name}"[:100], "by": unit.name[:100], "time": first, "end": last,
            "geometry": {"type": "LineString", "coordinates": line}, **seen,
        }  # fmt: skip

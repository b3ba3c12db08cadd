# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The file of a search plan for programs: where each unit is when, and what it sees."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dsse_ros.base.fields import FieldError, Spec, shown
from dsse_ros.base.json_reader import read_json
from dsse_ros.planners.search_plan.assignments import Assignment
from dsse_ros.planners.search_plan.timed_tracks import TimedTrack, TrackSearch
from dsse_ros.world.drift.flow import utc
from dsse_ros.world.scenario.geodesy import geodetic_to_search, search_to_geodetic
from dsse_ros.world.scenario.place_checks import LAT, LON, check_near
from dsse_ros.world.scenario.scenario import ResolvedScenario, scenario_frame
from dsse_ros.world.scenario.sighting_fields import time_of
from dsse_ros.world.sensors.lateral_range import LateralRange

_NUMBER = Spec("float", "", low=-1e7, high=1e7)
_SEEN = Spec("float", "", low=0, high=1e7)
_LEAST_POINTS = 2


class PlannedUnit(NamedTuple):
    """A unit of a plan in a search.

    Attributes:
        name: Its name.
        way: Where it is when, from its base along its track and, if it returns, to its base.
        search: Its search.
    """

    name: str
    way: TimedTrack
    search: TrackSearch

    def drone(self, count: int) -> int | None:
        """Return the number of the drone that flies it, of a search with so many; else None."""
        numbered = re.fullmatch(r"drone(\d{1,6})", self.name)
        return int(numbered[1]) if numbered and int(numbered[1]) < count else None


def plan_text(scenario: ResolvedScenario, assignments: Sequence[Assignment]) -> str:
    """Return the content of the file of a plan."""
    frame, units = scenario_frame(scenario), []
    # Times count from a whole second.
    begins = round(begins_s(scenario))
    later_s = begins_s(scenario) - begins
    for assignment in assignments:
        (points, times), unit = assignment.timed_way, assignment.unit
        lats, lons = search_to_geodetic(frame, points[:, 0], points[:, 1])
        units.append(
            {
                "name": unit.name, "altitude": unit.altitude_m, "sees": unit.lateral._asdict(),
                "commences": assignment.commences_s + later_s, "ends": assignment.ends_s + later_s,
                "track": np.stack([lats, lons, times + later_s], axis=1).tolist(),
            }
        )  # fmt: skip
    document = {"search_plan": 1, "begins": utc(begins), "units": units}
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def read_plan(path: str | os.PathLike[str], scenario: ResolvedScenario) -> list[PlannedUnit]:
    """Return the units of a plan in a search, whose grid and beginning may be others.

    Raises:
        FieldError: If the file cannot be read or is no plan for this search.
    """
    try:
        if scenario.incident is None:
            raise FieldError("the scenario must have an incident")
        try:
            content = read_json(Path(path).read_bytes(), "plan")
        except OSError as error:
            raise FieldError(str(error.strerror)) from None
        if not isinstance(content, Mapping) or content.get("search_plan") != 1:
            raise FieldError(f"content must be a search plan, as plan_search writes it, got "
                             f"{shown(content)}")  # fmt: skip
        later_s = time_of("begins", content.get("begins")) - begins_s(scenario)
        units = content.get("units")
        if not isinstance(units, list) or not units:
            raise FieldError(f"units must be a list of units, got {shown(units)}")
        return [
            _unit(f"units[{number}]", each, scenario, later_s) for number, each in enumerate(units)
        ]
    except ValueError as error:
        raise FieldError(f"{os.fspath(path)}: {error}") from None


def begins_s(scenario: ResolvedScenario) -> float:
    """Return when a search begins, seconds since 1970-01-01 UTC."""
    assert scenario.begins_s is not None
    return scenario.begins_s


def _unit(where: str, stated: Any, scenario: ResolvedScenario, later_s: float) -> PlannedUnit:
    """Return a unit whose times count from `later_s` after the search began."""
    if not isinstance(stated, Mapping):
        raise FieldError(f"{where} must be a mapping, got {shown(stated)}")
    name, sees, track = (stated.get(key) for key in ("name", "sees", "track"))
    if not isinstance(name, str) or not name:
        raise FieldError(f"{where}.name must be a name, got {shown(name)}")
    if not isinstance(sees, Mapping) or sees.keys() != set(LateralRange._fields):
        raise FieldError(
            f"{where}.sees must have {', '.join(LateralRange._fields)}, got {shown(sees)}"
        )
    if not isinstance(track, list) or len(track) < _LEAST_POINTS:
        raise FieldError(f"{where}.track must be a list of two points or more, got {shown(track)}")
    points = [_point(f"{where}.track[{number}]", each) for number, each in enumerate(track)]
    frame, (lats, lons, times) = scenario_frame(scenario), np.array(points).T
    if (np.diff(times) < 0).any():
        raise FieldError(f"{where}.track must not go back in time, got {shown(times.tolist())}")
    check_near(f"{where}.track", (float(lats[0]), float(lons[0])), frame.origin[:2])
    places = np.stack(geodetic_to_search(frame, lats, lons), axis=1)
    way = TimedTrack(places, times + later_s)
    lateral = LateralRange(
        **{key: _SEEN.check(f"{where}.sees.{key}", value) for key, value in sees.items()}
    )
    begins, ends = (
        _NUMBER.check(f"{where}.{key}", stated.get(key)) + later_s for key in ("commences", "ends")
    )
    search = way.between(begins, ends)
    if not len(search.times_s):
        raise FieldError(
            f"{where}.ends must be later than commences, both within the times of track, got "
            f"{stated['commences']:g} and {stated['ends']:g}"
        )
    return PlannedUnit(name, way, TrackSearch(search, lateral))


def _point(where: str, stated: Any) -> tuple[float, float, float]:
    """Return latitude, longitude and time of a point."""
    try:
        lat, lon, time_s = stated
        return LAT.check(where, lat), LON.check(where, lon), _NUMBER.check(where, time_s)
    except (TypeError, ValueError):
        raise FieldError(
            f"{where} must be [latitude, longitude, seconds], got {shown(stated)}"
        ) from None

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The units of a search in a YAML file: a mapping with a list `units` of mappings."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from dsse_ros.base.fields import FieldError, check_all, check_known, field, shown, specs
from dsse_ros.planners.search_plan.assignments import PATTERNS, SearchUnit
from dsse_ros.world.drift.flow import utc
from dsse_ros.world.scenario.geodesy import geodetic_to_search
from dsse_ros.world.scenario.place_checks import LAT, LON, check_near, place_of
from dsse_ros.world.scenario.scenario import ResolvedScenario, scenario_frame
from dsse_ros.world.scenario.sighting_fields import time_of
from dsse_ros.world.scenario.yaml_file import read_yaml
from dsse_ros.world.searchers.searcher import Searcher
from dsse_ros.world.sensors.lateral_range import LateralRange
from dsse_ros.world.sensors.registry import SENSORS
from dsse_ros.world.sensors.sweep_width import PLATFORMS

MAX_UNITS = 20


@dataclass(frozen=True, kw_only=True)
class UnitFields:
    """A unit as its file states it.

    Raises:
        FieldError: If a value is not allowed.
    """

    name: str = field("str", "Name of the unit.")
    speed: float = field("float", "Speed over ground.", low=0.1, high=1000, unit="m/s")
    base: tuple[float, float] | None = field(
        "vector", "Latitude and longitude where it starts; by default the base of the incident.",
        None,
    )  # fmt: skip
    ready: str | None = field(
        "str", "Time at which it leaves its base, by default the start of the search.", None
    )
    endurance: float | None = field(
        "float", "Longest time from its base back to its base; by default no limit, and no return.",
        None, above=0, high=1e4, unit="min",
    )  # fmt: skip
    on_scene: float | None = field(
        "float", "Longest time in its area, by default no limit.", None, above=0, high=1e4,
        unit="min",
    )  # fmt: skip
    altitude: float | None = field(
        "float", "Height of its eyes or camera above the sea, by default the scenario's.", None,
        low=1e-3, high=20000, unit="m",
    )  # fmt: skip
    sweep_width: float | None = field(
        "float", "Sweep width, by the inverse cube law; instead of a sensor.", None, above=0,
        high=1e5, unit="m",
    )  # fmt: skip
    sensor: str | None = field(
        "str", "Sensor, by default the scenario's.", None, choices=SENSORS.keys()
    )
    platform: str | None = field(
        "str", "Platform of the sensor sweep_width, by default the scenario's.", None,
        choices=PLATFORMS,
    )  # fmt: skip
    turn: float = field(
        "float", "Time of each turn of its track, in which it sees nothing.", 0.0, low=0, high=3600,
        unit="s",
    )  # fmt: skip
    afloat: bool = field("bool", "Whether its track must not cross the incident's `shore`.", False)
    patterns: tuple[str, ...] = field(
        "names", "Patterns that it flies, PS and CS by default.", PATTERNS
    )

    def __post_init__(self) -> None:
        check_all(self)
        if not self.name:
            raise FieldError("name must be a name, got ''")
        for pattern in self.patterns:
            if pattern not in PATTERNS:
                raise FieldError(
                    f"patterns must be among {', '.join(PATTERNS)}, got {shown(pattern)}"
                )
        if not self.patterns:
            raise FieldError(f"patterns must be among {', '.join(PATTERNS)}, got none")
        if self.sweep_width is not None:
            for name in ("sensor", "platform"):
                if getattr(self, name) is not None:
                    raise FieldError(
                        f"{name} must not be given with sweep_width, got "
                        f"{shown(getattr(self, name))}"
                    )

    def unit(
        self, scenario: ResolvedScenario, default_base: tuple[float, float] | None
    ) -> SearchUnit:
        """Return the unit in a search that begins with its incident.

        Args:
            scenario: Of the search.
            default_base: Latitude and longitude of the base of a unit that states none.

        Raises:
            FieldError: If a value does not fit the search.
        """
        assert scenario.incident is not None
        summary = scenario.incident.grid_summary
        assert summary is not None
        until_s = scenario.timestep_limit * scenario.step_duration_s
        ready_s = 0.0
        if self.ready is not None:
            ready_s = time_of("ready", self.ready) - summary.begins_s
            if not 0 <= ready_s < until_s:
                raise FieldError(
                    f"ready must be from {utc(summary.begins_s)} to before "
                    f"{utc(summary.begins_s + until_s)}, got {self.ready!r}"
                )
        lateral = self._lateral(scenario)
        if not (lateral.sweep_width_m or lateral.reach_m * lateral.pod):
            raise FieldError("sensor must have a sweep width > 0 m, got 0")
        return SearchUnit(
            self.name, self.speed, self._base(scenario, default_base), ready_s, until_s, lateral,
            math.inf if self.on_scene is None else self.on_scene * 60,
            math.inf if self.endurance is None else self.endurance * 60, self.patterns,
            self.altitude or scenario.altitude, self.turn, self.afloat,
        )  # fmt: skip

    def _base(
        self, scenario: ResolvedScenario, default: tuple[float, float] | None
    ) -> tuple[float, float]:
        """Return its base, metres to the east and to the south of the north-west corner."""
        place = self.base or default
        if place is None:
            raise FieldError("base must be given, as the incident has none")
        lat, lon = LAT.check("base: latitude", place[0]), LON.check("base: longitude", place[1])
        frame = scenario_frame(scenario)
        check_near("base", (lat, lon), frame.origin[:2])
        east, south = geodetic_to_search(frame, lat, lon)
        return float(east), float(south)

    def _lateral(self, scenario: ResolvedScenario) -> LateralRange:
        """Return how it sees what it passes."""
        if self.sweep_width is not None:
            return LateralRange(sweep_width_m=self.sweep_width, speed_mps=self.speed)
        name = self.sensor or scenario.sensor
        lateral = SENSORS[name].lateral
        if lateral is None:
            raise FieldError(f"sensor must see in passing, got {name!r}")
        kind = Searcher(
            doc="searches", speed=self.speed, altitude=self.altitude or scenario.altitude,
            sensor=name,
        )  # fmt: skip
        if self.platform is not None:
            scenario = replace(scenario, platform=self.platform)
        try:
            return lateral(scenario, kind)
        except ValueError as error:
            raise FieldError(f"sensor: {name}: {error}") from None


def read_units(path: str | os.PathLike[str]) -> list[UnitFields]:
    """Return the units of a file.

    Raises:
        FieldError: If the file cannot be read, or a value is not allowed.
    """
    try:
        content = read_yaml(path)
        if not isinstance(content, Mapping):
            raise FieldError(f"content must be a mapping with units, got {shown(content)}")
        check_known("the file", content, ["units"])
        listed = content.get("units")
        if not isinstance(listed, list) or not 1 <= len(listed) <= MAX_UNITS:
            raise FieldError(f"units must be a list of 1 to {MAX_UNITS} units, got {shown(listed)}")
        units = [_unit(f"units[{number}]", each) for number, each in enumerate(listed)]
        names = [unit.name for unit in units]
        for name in names:
            if names.count(name) > 1:
                raise FieldError(f"name must be different for each unit, got {name!r} twice")
    except FieldError as error:
        raise FieldError(f"{os.fspath(path)}: {error}") from None
    return units


def _unit(where: str, values: Any) -> UnitFields:
    if not isinstance(values, Mapping):
        raise FieldError(f"{where} must be a mapping, got {shown(values)}")
    check_known(where, values, specs(UnitFields))
    for name in ("name", "speed"):
        if values.get(name) is None:
            raise FieldError(f"{where}.{name} must be given")
    try:
        if isinstance(values.get("base"), str):
            values = {**values, "base": place_of("base", values["base"])}
        return UnitFields(**values)
    except FieldError as error:
        raise FieldError(f"{where}.{error}") from None

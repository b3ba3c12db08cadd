# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The drones of a scenario by kind: speed, altitude and endurance."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection
from dataclasses import dataclass

from dsse_ros.base.compiled.breadth_first import ROUNDING
from dsse_ros.base.fields import FieldError, field, shown
from dsse_ros.world.scenario.actions import STRAIGHT
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.searchers.registry import DEFAULT, SEARCHERS
from dsse_ros.world.searchers.searcher import Searcher
from dsse_ros.world.sensors.registry import SENSORS


@dataclass(frozen=True, kw_only=True)
class SearcherFields:
    """Properties of the drones; a kind of drone may override them."""

    altitude: float = field("float", "Height above the sea.", 120.0, low=1e-3, high=20000, unit="m")
    drone_speed: float = field(
        "float", "Airspeed of the drones.", 10.0, low=1e-3, high=1000, unit="m/s"
    )
    searchers: tuple[str, ...] = field(
        "names", "Kind of each drone, or one for all drones.", (DEFAULT,)
    )
    sensor: str | None = field(
        "str", "Sensor of drones whose kind has none.", None, choices=SENSORS.keys()
    )

    @property
    def kinds(self) -> tuple[Searcher, ...]:
        """The distinct kinds of the drones, with missing values from the scenario."""
        return tuple(
            dataclasses.replace(
                kind,
                speed=kind.speed or self.drone_speed,
                altitude=kind.altitude or self.altitude,
                sensor=kind.sensor or self.sensor,
            )
            for kind in (SEARCHERS[name] for name in dict.fromkeys(self.searchers))
        )

    @property
    def kind_of(self) -> tuple[int, ...]:
        """(N,) index in `kinds` of each drone's kind; only of a resolved scenario."""
        number = {name: i for i, name in enumerate(dict.fromkeys(self.searchers))}
        return tuple(number[name] for name in self.searchers)

    @property
    def speeds(self) -> tuple[float, ...]:
        """The airspeed of each of `kinds`, m/s."""
        return tuple(kind.speed or self.drone_speed for kind in self.kinds)

    @property
    def altitudes(self) -> tuple[float, ...]:
        """(N,) altitude of each drone, m; only of a resolved scenario."""
        of_kinds = [kind.altitude or self.altitude for kind in self.kinds]
        return tuple(of_kinds[number] for number in self.kind_of)

    def resolved_searchers(
        self, num_drones: int, rules: Rules, *, has_battery: bool
    ) -> tuple[str, ...]:
        """Return the name of each drone's kind, (N,).

        Args:
            num_drones: N.
            rules: Set the available actions.
            has_battery: Whether batteries run down, so that drones must find their way home.

        Raises:
            FieldError: If a kind is unknown, the number of kinds does not fit the drones, or a kind
                does not fit the rules.
        """
        names = self.searchers
        for name in names:
            if name not in SEARCHERS:
                raise FieldError(
                    f"searchers must be among {', '.join(SEARCHERS)}, got {shown(name)}"
                )
        if len(names) not in (1, num_drones):
            raise FieldError(
                f"searchers must be one kind for all drones or one per drone ({num_drones}), got "
                f"{len(names)}"
            )
        for name in dict.fromkeys(names):
            _check_kind(name, SEARCHERS[name], rules.actions, has_battery=has_battery)
        return names * num_drones if len(names) == 1 else names


def _check_kind(name: str, kind: Searcher, actions: Collection[str], *, has_battery: bool) -> None:
    """Raise unless a kind can fly a search."""
    where = f"searchers: {name!r}"
    for what in (
        "speed", "altitude", "endurance_min", "search_altitude", "descent_speed", "climb_speed",
        "search_time", "acceleration",
    ):  # fmt: skip
        value = getattr(kind, what)
        if value is not None and not (math.isfinite(value) and value > 0):
            raise FieldError(f"{where}: {what} must be a number > 0, got {shown(value)}")
    for what in ("min_speed", "turn_radius"):
        value = getattr(kind, what)
        if not (math.isfinite(value) and value >= 0):
            raise FieldError(f"{where}: {what} must be a number >= 0, got {shown(value)}")
    if kind.sensor is not None and kind.sensor not in SENSORS:
        raise FieldError(
            f"{where}: sensor must be one of {', '.join(SENSORS)}, got {shown(kind.sensor)}"
        )
    if kind.moves is None:
        return
    for move in kind.moves:
        if move not in actions:
            raise FieldError(
                f"{where}: moves must be among {', '.join(actions)}, got {shown(move)}"
            )
    missing = [move for move in STRAIGHT if move not in kind.moves]
    if has_battery and missing:
        raise FieldError(
            f"{where}: moves must include {', '.join(missing)} with battery_move, or it could not "
            f"return home, got {shown(list(kind.moves))}"
        )


def endurance_steps(kind: Searcher, step_duration_s: float) -> int:
    """Return a kind's endurance in whole steps, at least 1; 0 without an endurance."""
    if kind.endurance_min is None:
        return 0
    return max(math.floor(kind.endurance_min * 60 / step_duration_s + ROUNDING), 1)

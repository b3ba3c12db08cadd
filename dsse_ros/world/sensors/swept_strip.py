# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sensor of a crew that looks out to both sides, by tabulated sweep widths.

A move looks at the cells abeam of the cell that it enters, and a search at those along its row and
column, with half the effort each.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from dsse_ros.world.sensors.lateral_range import LAWS, LateralRange, Pods, in_place
from dsse_ros.world.sensors.sensor import SEARCH, Look, Sensor, looks_with
from dsse_ros.world.sensors.sweep_width import sweep_width_m

MAX_WIDTH = 8.0
"""Greatest sweep width in cells, half of what the looks of an action reach."""


def looks(scenario: Any, searcher: Any, action: str, heading: tuple[int, int]) -> Sequence[Look]:
    """Return the looks of an action by the sweep width of the scenario's object and platform.

    Raises:
        ValueError: If the tables do not have the sweep width, or it is too many cells wide.
    """
    if action != SEARCH and heading == (0, 0):
        return ()
    width_m = width_of(scenario, searcher)
    width = round(width_m / scenario.cell_size, 9)
    if width > MAX_WIDTH:
        raise ValueError(
            f"cell_size must be at least {width_m / MAX_WIDTH:g} m for a sweep width of "
            f"{width_m:g} m, got {scenario.cell_size:g}"
        )
    return looks_with(_pods(scenario.detection_law, width, heading), scenario)


def lateral(scenario: Any, searcher: Any) -> LateralRange:
    """Return the inverse cube law.

    Raises:
        ValueError: If the tables do not have the sweep width, or the scenario has another law.
    """
    if scenario.detection_law != "inverse_cube":
        raise ValueError(
            f"detection_law must be inverse_cube with space metres, got {scenario.detection_law!r}"
        )
    width_m = width_of(scenario, searcher)
    return LateralRange(sweep_width_m=width_m, speed_mps=searcher.speed)


def width_of(scenario: Any, searcher: Any) -> float:
    """Return the sweep width of a kind of drone in a scenario, in metres.

    Raises:
        ValueError: If the tables do not have it.
    """
    return sweep_width_m(
        scenario.search_object, scenario.platform, altitude_m=searcher.altitude,
        visibility_m=scenario.visibility, speed_mps=searcher.speed, weather=scenario.weather,
        fatigued=scenario.fatigue,
    )  # fmt: skip


@lru_cache(maxsize=128)
def _pods(law: str, width: float, heading: tuple[int, int]) -> Pods:
    if heading == (0, 0):
        return in_place((LAWS[law](width, (1, 0)), LAWS[law](width, (0, 1))))
    return LAWS[law](width, heading)


SWEPT_STRIP = Sensor(
    "sees to both sides of its path, by the sweep width of its object", looks, lateral
)

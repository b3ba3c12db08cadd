# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sweep widths of visual search at sea, as the U.S. Coast Guard tabulates them.

Source: "U.S. Coast Guard Addendum to the United States National Search and Rescue Supplement",
COMDTINST M16130.2F (2013), a work of the U.S. government in the public domain; the numbers as
extracted in marine-sweep-width-data (PDDL-1.0). `sweep_widths.csv` has sweep widths in nautical
miles by visibility in nautical miles, `sweep_width_factors.csv` the class of an object for weather
and its factors by speed in knots. An empty cell has the value to its left.

Values between the tabulated ones are interpolated linearly. Below the lowest height or speed the
values of that one apply, above the greatest visibility those of that one.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

NAUTICAL_MILE_M = 1852.0
KNOT_MPS = NAUTICAL_MILE_M / 3600
FOOT_M = 0.3048

WEATHER_FACTORS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "good": {"small": 1.0, "large": 1.0},
        "fair": {"small": 0.5, "large": 0.9},
        "poor": {"small": 0.25, "large": 0.9},
    }
)
"""Factors by weather and class of object: small are persons, rafts and boats shorter than 30 ft.
Weather is fair with wind over 15 kt or a sea of 2 to 3 ft, poor with wind over 25 kt or a sea over
4 ft."""
FATIGUE_FACTOR = 0.9
"""Factor for a tired crew."""


def _read(name: str, num_keys: int) -> tuple[list[str], dict[tuple[str, ...], list[float]]]:
    """Return the names of a table's columns of numbers, and each row's numbers by its keys."""
    with Path(__file__).with_name(name).open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    numbers: dict[tuple[str, ...], list[float]] = {}
    for row in rows:
        of_row = numbers[tuple(row[:num_keys])] = []
        for cell in row[num_keys:]:
            of_row.append(float(cell) if cell else of_row[-1])
    return head[num_keys:], numbers


_VISIBILITIES, _WIDTHS = _read("sweep_widths.csv", 3)
_SPEEDS, _FACTORS = _read("sweep_width_factors.csv", 2)
SEARCH_OBJECTS: Mapping[str, str] = MappingProxyType(
    {name: weather for name, weather in _FACTORS}  # noqa: C416
)
"""Class for weather, `small` or `large`, by object. `power_boat_15ft` are boats of up to 15 ft,
`ship_300ft` ships from 300 ft on."""
PLATFORMS = tuple(dict.fromkeys(platform for _, platform, _ in _WIDTHS))
"""From where people look out: fixed-wing aircraft, boats and helicopters."""


def sweep_width_m(
    search_object: str,
    platform: str,
    *,
    altitude_m: float,
    visibility_m: float,
    speed_mps: float = 0.0,
    weather: str = "good",
    fatigued: bool = False,
) -> float:
    """Return the corrected sweep width in metres.

    Args:
        search_object: One of `SEARCH_OBJECTS`.
        platform: One of `PLATFORMS`.
        altitude_m: Height of the eyes above the sea.
        visibility_m: Meteorological visibility, at least a nautical mile.
        speed_mps: Speed over the water; boats have no correction for it.
        weather: One of `WEATHER_FACTORS`.
        fatigued: Whether the crew is tired.

    Raises:
        ValueError: If a value is unknown, or outside the tables.
    """
    for field, name, known in (
        ("search_object", search_object, SEARCH_OBJECTS),
        ("platform", platform, PLATFORMS),
        ("weather", weather, WEATHER_FACTORS),
    ):
        if name not in known:
            raise ValueError(f"{field} must be one of {', '.join(known)}, got {name!r}")
    heights = {
        float(height) * FOOT_M: widths
        for (what, by, height), widths in _WIDTHS.items()
        if (what, by) == (search_object, platform)
    }
    kind = SEARCH_OBJECTS[search_object]
    speeds = {
        float(column.removeprefix(f"{platform}_")) * KNOT_MPS: factor
        for column, factor in zip(_SPEEDS, _FACTORS[search_object, kind], strict=True)
        if column.startswith(platform)
    } or {np.inf: 1.0}
    visibilities = np.array(_VISIBILITIES, float) * NAUTICAL_MILE_M
    if not visibility_m >= visibilities[0]:
        raise ValueError(f"visibility must be at least {visibilities[0]:g} m, got {visibility_m:g}")
    for field, value, most in (("altitude", altitude_m, heights), ("speed", speed_mps, speeds)):
        if not 0.0 <= value <= max(most):
            raise ValueError(
                f"{field} must be from 0 to {max(most):g} for platform {platform}, got {value:g}"
            )
    at_heights = [np.interp(visibility_m, visibilities, widths) for widths in heights.values()]
    return float(
        np.interp(altitude_m, list(heights), at_heights)
        * NAUTICAL_MILE_M
        * np.interp(speed_mps, list(speeds), list(speeds.values()))
        * WEATHER_FACTORS[weather][kind]
        * (FATIGUE_FACTOR if fatigued else 1.0)
    )

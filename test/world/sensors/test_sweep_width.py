# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sweep widths are those of the tables, with their corrections."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.world.sensors.sweep_width import (
    FOOT_M,
    KNOT_MPS,
    NAUTICAL_MILE_M,
    PLATFORMS,
    SEARCH_OBJECTS,
    WEATHER_FACTORS,
    sweep_width_m,
)

# Object, platform, height in ft, visibility in nm, sweep width in nm.
UNCORRECTED = [
    ("person_in_water", "aircraft", 300, 1, 0.1),
    ("person_in_water", "aircraft", 500, 1, 0.0),
    ("person_in_water", "aircraft", 750, 20, 0.1),
    ("person_in_water", "boat", 14, 1, 0.3),
    ("person_in_water", "boat", 14, 3, 0.4),
    ("person_in_water", "boat", 14, 5, 0.5),
    ("person_in_water", "boat", 8, 3, 0.2),
    ("person_in_water", "helicopter", 1500, 5, 0.0),
    ("raft_4_person", "helicopter", 300, 1, 0.5),
    ("raft_4_person", "helicopter", 300, 3, 1.2),
    ("raft_4_person", "helicopter", 300, 5, 1.6),
    ("raft_4_person", "helicopter", 300, 10, 2.2),
    ("raft_4_person", "helicopter", 300, 15, 2.5),
    ("raft_4_person", "helicopter", 300, 20, 2.7),
    ("raft_4_person", "aircraft", 3000, 20, 2.3),
    ("raft_4_person", "boat", 8, 20, 3.9),
]
# Object, platform, speed in kt, weather, whether the crew is tired, factor.
CORRECTED = [
    ("person_in_water", "helicopter", 60, "good", False, 1.5),
    ("person_in_water", "helicopter", 90, "good", False, 1.0),
    ("person_in_water", "helicopter", 120, "good", False, 0.8),
    ("person_in_water", "helicopter", 140, "good", False, 0.7),
    ("person_in_water", "aircraft", 150, "good", False, 1.2),
    ("person_in_water", "helicopter", 90, "fair", False, 0.5),
    ("person_in_water", "helicopter", 90, "poor", False, 0.25),
    ("person_in_water", "helicopter", 60, "poor", True, 1.5 * 0.25 * 0.9),
    ("raft_4_person", "helicopter", 60, "fair", True, 1.3 * 0.5 * 0.9),
    ("power_boat_33ft", "aircraft", 210, "poor", False, 0.9 * 0.9),
    ("ship_300ft", "aircraft", 210, "good", True, 0.9),
    ("ship_300ft", "boat", 30, "fair", False, 0.9),
]
CALM: dict[str, Any] = {"altitude_m": 300 * FOOT_M, "visibility_m": 10 * NAUTICAL_MILE_M}


@pytest.mark.parametrize(
    ("table", "keys", "count"), [("sweep_widths", 3, 2832), ("sweep_width_factors", 2, 148)]
)
def test_the_tables_have_every_published_number(table: str, keys: int, count: int) -> None:
    text = (files("dsse_ros.world.sensors") / f"{table}.csv").read_text(encoding="utf-8")
    rows = [line.split(",")[keys:] for line in text.splitlines()[1:]]
    assert sum(cell != "" for row in rows for cell in row) == count


@pytest.mark.parametrize(("name", "platform", "height_ft", "visibility_nm", "width"), UNCORRECTED)
def test_sweep_widths_are_those_of_the_tables(
    name: str, platform: str, height_ft: float, visibility_nm: float, width: float
) -> None:
    found = sweep_width_m(
        name, platform, altitude_m=height_ft * FOOT_M, visibility_m=visibility_nm * NAUTICAL_MILE_M,
        speed_mps={"aircraft": 180, "boat": 10, "helicopter": 90}[platform] * KNOT_MPS,
    )  # fmt: skip
    assert found / NAUTICAL_MILE_M == pytest.approx(width, abs=1e-9)


@pytest.mark.parametrize(("name", "platform", "speed_kt", "weather", "tired", "factor"), CORRECTED)
def test_corrections_multiply(
    name: str, platform: str, speed_kt: float, weather: str, tired: bool, factor: float
) -> None:
    height = {**CALM, "altitude_m": (8 if platform == "boat" else 300) * FOOT_M}
    uncorrected_kt = {"aircraft": 180, "boat": 0, "helicopter": 90}[platform]
    calm = sweep_width_m(name, platform, speed_mps=uncorrected_kt * KNOT_MPS, **height)
    found = sweep_width_m(
        name, platform, speed_mps=speed_kt * KNOT_MPS, weather=weather, fatigued=tired, **height
    )
    assert calm > 0
    assert found == pytest.approx(calm * factor)


@given(
    name=st.sampled_from(sorted(SEARCH_OBJECTS)),
    platform=st.sampled_from(PLATFORMS),
    visibilities=st.tuples(*[st.floats(1.0, 40.0)] * 2).map(sorted),
    height_ft=st.floats(0.0, 14.0),
)
def test_nobody_sees_less_far_in_better_visibility_or_further_in_worse_weather(
    name: str, platform: str, visibilities: list[float], height_ft: float
) -> None:
    hazy, clear = (
        [
            sweep_width_m(
                name, platform, altitude_m=height_ft * FOOT_M, weather=weather,
                visibility_m=visibility * NAUTICAL_MILE_M,
            )
            for weather in WEATHER_FACTORS
        ]
        for visibility in visibilities
    )  # fmt: skip
    assert all(a <= b + 1e-9 for a, b in zip(hazy, clear, strict=True))
    assert clear == sorted(clear, reverse=True)


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"search_object": "kayak"}, "search_object must be one of person_in_water, .*got 'kayak'"),
        ({"platform": "drone"}, "platform must be one of aircraft, boat, helicopter, got 'drone'"),
        ({"weather": "storm"}, "weather must be one of good, fair, poor, got 'storm'"),
        ({"altitude_m": 915.0}, "altitude must be from 0 to 914.4 for platform helicopter"),
        ({"visibility_m": 1851.0}, "visibility must be at least 1852 m, got 1851"),
        ({"visibility_m": float("nan")}, "visibility must be at least 1852 m, got nan"),
        ({"speed_mps": 73.0}, "speed must be from 0 to 72.0222 for platform helicopter, got 73"),
    ],
)
def test_what_the_tables_do_not_have_is_refused_in_a_line(
    changed: dict[str, Any], why: str
) -> None:
    stated = {"search_object": "person_in_water", "platform": "helicopter", **CALM, **changed}
    with pytest.raises(ValueError, match=why) as error:
        sweep_width_m(**stated)
    assert "\n" not in str(error.value)

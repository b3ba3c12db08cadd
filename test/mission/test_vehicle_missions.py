# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles fly in layers, none of which is below or above what is allowed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.mission.vehicle_missions import FlightSettings, layers
from dsse_ros.search import FieldError
from msg_adapters.frames import GridFrame

FRAME = GridFrame(10, 130.0, -24.0, -46.0, 0.0, 120.0)


@given(
    st.integers(1, 250),
    st.floats(0.0, 100.0),
    st.just(-1.0) | st.floats(0.0, 20.0),
    st.floats(1, 300),
)
def test_layers_are_as_far_apart_as_asked_and_none_is_too_low(
    vehicles: int, lowest_m: float, step_m: float, alt_m: float
) -> None:
    frame = GridFrame(10, 130.0, -24.0, -46.0, 0.0, alt_m)
    settings = FlightSettings(altitude_step=step_m)
    room_m = max(alt_m - lowest_m, 0.0)
    try:
        altitudes = [one.alt_m for one in layers(frame, settings, vehicles, lowest_m)]
    except FieldError as error:
        assert step_m >= 0 and step_m * (vehicles - 1) > room_m
        assert "altitude_step" in str(error) and "\n" not in str(error)
        return
    assert len(altitudes) == vehicles and altitudes[0] == alt_m
    assert min(altitudes) >= min(lowest_m, alt_m) - 1e-9
    steps = [high - low for high, low in zip(altitudes, altitudes[1:], strict=False)]
    wanted = min(5.0, room_m / max(vehicles - 1, 1)) if step_m < 0 else step_m
    assert steps == pytest.approx([wanted] * (vehicles - 1), abs=1e-6)


def test_the_error_says_how_much_room_there_is() -> None:
    with pytest.raises(FieldError, match="30 is not allowed; 5 vehicles .* have room for 27.5 m"):
        layers(FRAME, FlightSettings(altitude_step=30.0), 5)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A vehicle whose own return leaves its layer is named, with the parameter that makes it."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.autopilots import AUTOPILOTS
from dsse_ros.vehicles.control.vehicle_state import VehicleState, observe
from dsse_ros.vehicles.fleet.fence import Fence
from dsse_ros.vehicles.fleet.layer import Layer
from dsse_ros.vehicles.fleet.own_return import reason_to_leave
from dsse_ros.vehicles.fleet.settings import BridgeSettings
from dsse_ros.vehicles.mavlink.messages import ParamValue
from dsse_ros.world.scenario.frames import GridFrame

HOME_M = 5.0
FENCE = Fence(GridFrame(10, 130.0, -24.0, -46.0, 0.0, 120.0), 500.0, 10.0, 150.0)


@pytest.mark.parametrize(
    ("autopilot", "name", "value", "reason"),
    [
        ("ardupilot", "RTL_ALT", 1500.0, ""),
        ("arduplane", "RTL_ALTITUDE", -1.0, ""),
        ("arduplane", "RTL_ALTITUDE", 115.0, ""),
        ("arduplane", "ALT_HOLD_RTL", 11_500.0, ""),
        (
            "arduplane",
            "RTL_ALTITUDE",
            100.0,
            "ALT_HOLD_RTL or RTL_ALTITUDE must be 115 m to circle",
        ),
        ("arduplane", "RTL_ALTITUDE", 130.0, "altitude must be at least 130 m above home"),
        ("px4plane", "RTL_RETURN_ALT", 100.0, ""),
        ("px4plane", "RTL_DESCEND_ALT", 100.0, "RTL_DESCEND_ALT must be 115 m to circle"),
        ("px4plane", "RTL_DESCEND_ALT", 115.0, ""),
        ("px4", "RTL_DESCEND_ALT", 10.0, ""),
    ],
)
def test_a_return_out_of_the_layer_is_named_with_its_parameter(
    autopilot: str, name: str, value: float, reason: str
) -> None:
    one = AUTOPILOTS[autopilot]
    message = ParamValue(name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32, 2, 0)
    state = observe(VehicleState(alt_amsl_m=HOME_M, alt_m=0.0), message, 1.0, one)
    named = reason_to_leave(state, Layer(FENCE, BridgeSettings(autopilot=autopilot), 13.0))
    assert reason in (named or "") and bool(named) == bool(reason)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the bridge that depend on whose autopilots the vehicles have."""

from __future__ import annotations

import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.ros.nodes.mavlink_bridge import _fleet
from dsse_ros.vehicles.fleet.settings import BridgeSettings


@pytest.mark.parametrize(
    ("autopilot", "ports"), [("ardupilot", (14550, 14560)), ("px4", (14540, 14541))]
)
def test_vehicles_are_waited_for_where_their_simulator_sends_to(
    autopilot: str, ports: tuple[int, ...]
) -> None:
    fleet = _fleet(BridgeSettings(autopilot=autopilot, num_vehicles=2))
    assert fleet is not None
    connections = [vehicle.settings.connection for vehicle in fleet]
    fleet.close()
    assert connections == [f"udpin:127.0.0.1:{port}" for port in ports]


def test_px4_needs_more_than_two_setpoints_a_second() -> None:
    assert BridgeSettings(setpoint_rate=2.1).setpoint_rate == 2.1
    with pytest.raises(FieldError, match="setpoint_rate"):
        BridgeSettings(setpoint_rate=2.0)

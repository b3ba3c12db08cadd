# SPDX-License-Identifier: Apache-2.0
"""Settings of the bridge that depend on whose autopilots the vehicles have."""

from __future__ import annotations

import pytest

from dsse_ros.flight.flight_settings import BridgeSettings
from dsse_ros.nodes.mavlink_bridge import _fleet
from dsse_ros.search import FieldError


@pytest.mark.parametrize(
    ("dialect", "ports"), [("ardupilot", (14550, 14560)), ("px4", (14540, 14541))]
)
def test_vehicles_are_waited_for_where_their_simulator_sends_to(
    dialect: str, ports: tuple[int, ...]
) -> None:
    fleet = _fleet(BridgeSettings(dialect=dialect, num_vehicles=2))
    assert fleet is not None
    connections = [vehicle.settings.connection for vehicle in fleet]
    fleet.close()
    assert connections == [f"udpin:127.0.0.1:{port}" for port in ports]


def test_px4_needs_more_than_two_set_points_a_second() -> None:
    assert BridgeSettings(set_point_rate=2.1).set_point_rate == 2.1
    with pytest.raises(FieldError, match="set_point_rate"):
        BridgeSettings(set_point_rate=2.0)

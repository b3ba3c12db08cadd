# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the bridge that do not fit together are refused in one line."""

from __future__ import annotations

from typing import Any

import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.vehicles.fleet.settings import BridgeSettings


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (
            {"num_vehicles": 3, "connections": ("tcp:127.0.0.1:5760",)},
            "connections must be one for each of 3 vehicles, got 1",
        ),
        (
            {"num_vehicles": 2, "system_ids": (1, 2, 3)},
            "system_ids must be one for each of 2 vehicles, got 3",
        ),
        (
            {"num_vehicles": 3, "altitudes": (60.0, 50.0)},
            "altitudes must be one for each of 3 vehicles, got 2",
        ),
        (
            {"num_vehicles": 2, "system_ids": (4, 4)},
            "system_ids must differ, got 4 for 2 vehicles",
        ),
        (
            {"fence_center": (91.0, 0.0)},
            "fence_center must be latitude and longitude, got (91.0, 0.0)",
        ),
        (
            {"fence_center": (0.0, -181.0)},
            "fence_center must be latitude and longitude, got (0.0, -181.0)",
        ),
        (
            {"min_altitude": 200.0},
            "min_altitude must be at most max_altitude, 150 m, got 200",
        ),
        (
            {"link_timeout": 40.0},
            "lost_timeout must be at least link_timeout, 40 s, got 30",
        ),
        (
            {"own_system_id": 2, "num_vehicles": 2},
            "own_system_id must not be a vehicle's system id, got 2",
        ),
        (
            {"system_ids": (245,)},
            "own_system_id must not be a vehicle's system id, got 245",
        ),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(given: dict[str, Any], why: str) -> None:
    with pytest.raises(FieldError) as refused:
        BridgeSettings(**given)
    assert str(refused.value) == why


def test_each_vehicle_has_a_connection_unless_none_is_named() -> None:
    connections = ("tcp:127.0.0.1:5760", "tcp:127.0.0.1:5770")
    assert BridgeSettings(connections=connections).vehicles == 2
    assert BridgeSettings(num_vehicles=3).vehicles == 3
    assert BridgeSettings().vehicles == 1


def test_one_altitude_does_for_all() -> None:
    settings = BridgeSettings(num_vehicles=3, altitudes=(60.0,), fence_center=(-24.0, -46.0))
    assert settings.altitudes == (60.0,)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The text of QGroundControl's `.plan` files.

Format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html.
"""

from __future__ import annotations

import json
import math
from typing import Any

from dsse_ros.vehicles.mission_items.items import (
    DO_CHANGE_SPEED,
    MissionItem,
    VehicleMission,
    check_item,
)

_SPEED_MPS = 10.0
"""Speed in QGroundControl's estimates of a mission that does not set its own."""
_ALTITUDE_ABOVE_HOME = 1
_PLAN_VERSION = 1
_MISSION_VERSION = 2
_FENCE_VERSION = 2
_RALLY_VERSION = 2


def plan_text(mission: VehicleMission, firmware: int, vehicle: int) -> str:
    """Return the text of a `.plan` file, whose numbers are exact; NaN is written as null.

    Args:
        mission: The mission.
        firmware: MAV_AUTOPILOT of the vehicle.
        vehicle: MAV_TYPE of the vehicle.

    Raises:
        ValueError: If an item or home has a place that is not finite or not on the Earth, or a
            number is infinite.
    """
    lat_deg, lon_deg, alt_m = mission.home
    check_item(MissionItem(0, lat_deg=lat_deg, lon_deg=lon_deg, alt_m=alt_m), "home")
    speeds_mps = [item.param2 for item in mission.items if item.command == DO_CHANGE_SPEED]
    speed_mps = (*speeds_mps, _SPEED_MPS)[0]
    document = {
        "fileType": "Plan",
        "geoFence": {"circles": [], "polygons": [], "version": _FENCE_VERSION},
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": speed_mps,
            "firmwareType": firmware,
            "globalPlanAltitudeMode": _ALTITUDE_ABOVE_HOME,
            "hoverSpeed": speed_mps,
            "items": [_simple_item(number, item) for number, item in enumerate(mission.items, 1)],
            "plannedHomePosition": list(mission.home),
            "vehicleType": vehicle,
            "version": _MISSION_VERSION,
        },
        "rallyPoints": {"points": [], "version": _RALLY_VERSION},
        "version": _PLAN_VERSION,
    }
    return json.dumps(document, indent=4, allow_nan=False) + "\n"


def _simple_item(number: int, item: MissionItem) -> dict[str, Any]:
    # Items are numbered from 1: 0 is home, which is kept apart.
    check_item(item, f"item {number}")
    return {
        "autoContinue": True,
        "command": item.command,
        "doJumpId": number,
        "frame": item.frame,
        "params": [None if math.isnan(value) else value for value in item.numbers.values()],
        "type": "SimpleItem",
    }

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The text of QGroundControl's `.plan` files.

Format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html.
"""

from __future__ import annotations

import json
import math
from typing import Any

from msg_adapters.mission_items import FIRMWARES, Home, Mission, MissionItem, check_place

MAV_TYPE_QUADROTOR = 2

_ALTITUDE_ABOVE_HOME = 1
_PLAN_VERSION = 1
_MISSION_VERSION = 2
_FENCE_VERSION = 2
_RALLY_VERSION = 2


def plan_text(
    mission: Mission,
    *,
    firmware: str = "ardupilot",
    cruise_speed_mps: float = 10.0,
    hover_speed_mps: float = 10.0,
) -> str:
    """Return the text of a `.plan` file, whose numbers are exact; NaN is written as null.

    Args:
        mission: The mission.
        firmware: One of `FIRMWARES`.
        cruise_speed_mps: Speed of winged vehicles, for estimates.
        hover_speed_mps: Speed of the others, for estimates.

    Raises:
        ValueError: If an item or home has a place that is not finite or not on the Earth, or a
            number is infinite.
    """
    _check_home(mission.home, "home")
    document = {
        "fileType": "Plan",
        "geoFence": {"circles": [], "polygons": [], "version": _FENCE_VERSION},
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": cruise_speed_mps,
            "firmwareType": FIRMWARES[firmware].mav_autopilot,
            "globalPlanAltitudeMode": _ALTITUDE_ABOVE_HOME,
            "hoverSpeed": hover_speed_mps,
            "items": [_simple_item(number, item) for number, item in enumerate(mission.items, 1)],
            "plannedHomePosition": list(mission.home),
            "vehicleType": MAV_TYPE_QUADROTOR,
            "version": _MISSION_VERSION,
        },
        "rallyPoints": {"points": [], "version": _RALLY_VERSION},
        "version": _PLAN_VERSION,
    }
    return json.dumps(document, indent=4, allow_nan=False) + "\n"


def _simple_item(number: int, item: MissionItem) -> dict[str, Any]:
    # Items are numbered from 1: 0 is home, which is kept apart.
    check_place(item, f"item {number}")
    numbers = (
        item.param1,
        item.param2,
        item.param3,
        item.param4,
        item.lat_deg,
        item.lon_deg,
        item.alt_m,
    )
    if any(math.isinf(value) for value in numbers):
        raise ValueError(f"item {number}: an infinite parameter is not allowed; a number")
    return {
        "autoContinue": True,
        "command": item.command,
        "doJumpId": number,
        "frame": item.frame,
        "params": [None if math.isnan(value) else value for value in numbers],
        "type": "SimpleItem",
    }


def _check_home(home: Home, where: str) -> None:
    check_place(MissionItem(0, lat_deg=home.lat_deg, lon_deg=home.lon_deg, alt_m=home.alt_m), where)

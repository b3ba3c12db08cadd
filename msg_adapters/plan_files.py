# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The text of QGroundControl's `.plan` files.

Format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

from msg_adapters.json_keys import Keys, parse_json
from msg_adapters.mission_items import FIRMWARES, Home, Mission, MissionItem, check_place

MAV_TYPE_QUADROTOR = 2

_ALTITUDE_ABOVE_HOME = 1
_PLAN_VERSION = 1
_MISSION_VERSION = 2
_FENCE_VERSION = 2
_RALLY_VERSION = 2


@dataclass(frozen=True)
class Plan:
    """What a `.plan` file says.

    Attributes:
        mission: The mission.
        firmware: One of `FIRMWARES`; None for one that is not known here.
        cruise_speed_mps: Speed of winged vehicles, for estimates.
        hover_speed_mps: Speed of the others, for estimates.
    """

    mission: Mission
    firmware: str | None
    cruise_speed_mps: float
    hover_speed_mps: float


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


def parse_plan(text: str) -> Plan:
    """Return what a `.plan` file says: the inverse of `plan_text`.

    Fences, rally points and keys of later versions are ignored.

    Raises:
        ValueError: If the text is not such a file, or has a pattern such as a survey, which only
            a ground station can turn into items; one line that names the key.
    """
    plan = Keys(parse_json(text, "plan"), "plan")
    if plan.text("fileType") != "Plan":
        plan.refuse("fileType", "'Plan'")
    plan.integer("version", _PLAN_VERSION, _PLAN_VERSION)
    keys = plan.inner("mission")
    keys.integer("version", _MISSION_VERSION, _MISSION_VERSION)
    home = Home(*keys.numbers("plannedHomePosition", 3))
    _check_home(home, "plan.mission.plannedHomePosition")
    firmware_type = keys.integer("firmwareType", 0, 255)
    return Plan(
        mission=Mission(
            home,
            tuple(
                _parse_item(entry, f"plan.mission.items[{index}]")
                for index, entry in enumerate(keys.entries("items"))
            ),
        ),
        firmware=next(
            (name for name, one in FIRMWARES.items() if one.mav_autopilot == firmware_type), None
        ),
        cruise_speed_mps=keys.number("cruiseSpeed"),
        hover_speed_mps=keys.number("hoverSpeed"),
    )


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


def _parse_item(entry: Any, where: str) -> MissionItem:
    keys = Keys(entry, where)
    if keys.text("type") != "SimpleItem":
        keys.refuse("type", "'SimpleItem'; save surveys and other patterns as waypoints")
    param1, param2, param3, param4, lat_deg, lon_deg, alt_m = keys.numbers(
        "params", 7, null=math.nan
    )
    item = MissionItem(
        command=keys.integer("command", 0, 65535),
        frame=keys.integer("frame", 0, 255),
        param1=param1,
        param2=param2,
        param3=param3,
        param4=param4,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        alt_m=alt_m,
    )
    check_place(item, where)
    return item


def _check_home(home: Home, where: str) -> None:
    check_place(MissionItem(0, lat_deg=home.lat_deg, lon_deg=home.lon_deg, alt_m=home.alt_m), where)

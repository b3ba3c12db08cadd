# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mission items as MAVLink's MISSION_ITEM_INT.

https://mavlink.io/en/messages/common.html#MISSION_ITEM_INT; use of the fields:
https://mavlink.io/en/services/mission.html ("Frames & Positional Information").
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.base.checks import check_number
from dsse_ros.vehicles.mission_items.items import FRAME_MISSION, NAV_LOITER_TIME, MissionItem

INTEGER_FRAMES = {
    mavlink.MAV_FRAME_GLOBAL: mavlink.MAV_FRAME_GLOBAL_INT,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT: mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
}
"""Frames by the equivalent ones whose places are integers, as on the wire."""
_DEGREE = 10**7
_MAX_FLOAT32 = float.fromhex("0x1.fffffep+127")


def item_message(
    item: MissionItem, seq: int, target: tuple[int, int] = (0, 0)
) -> mavlink.MAVLink_mission_item_int_message:
    """Return an item as a MISSION_ITEM_INT.

    Frames become their integer equivalents; a hold whose yaw is left open gets 0, since ArduPilot
    refuses a NaN there.

    Args:
        item: The item.
        seq: Its number.
        target: System and component id of the vehicle's autopilot.

    Raises:
        ValueError: If a value, such as a place that is not finite, does not fit the message.
    """
    for name, number, most in (
        ("seq", seq, 2**16 - 1),
        ("frame", item.frame, 2**8 - 1),
        ("command", item.command, 2**16 - 1),
    ):
        check_number(name, number, 0, most)
    open_yaw = item.command == NAV_LOITER_TIME and math.isnan(item.param4)
    yaw = 0.0 if open_yaw else item.param4
    scale = 1 if item.frame == FRAME_MISSION else _DEGREE
    return mavlink.MAVLink_mission_item_int_message(
        *target,
        seq,
        INTEGER_FRAMES.get(item.frame, item.frame),
        item.command,
        int(seq == 0),
        1,
        _float("param1", item.param1),
        _float("param2", item.param2),
        _float("param3", item.param3),
        _float("param4", yaw),
        _integer("latitude", item.lat_deg, scale),
        _integer("longitude", item.lon_deg, scale),
        _float("altitude", item.alt_m),
    )


def mission_messages(
    items: Iterable[MissionItem], target: tuple[int, int] = (0, 0)
) -> tuple[mavlink.MAVLink_mission_item_int_message, ...]:
    """Return the items of a mission as `item_message`, numbered from 0."""
    return tuple(item_message(item, seq, target) for seq, item in enumerate(items))


def _integer(name: str, value: float, scale: int) -> int:
    if not abs(value * scale) < 2**31 - 1:
        raise ValueError(f"{name} must be a number that fits 32 bits, got {value!r}")
    return int(round(value * scale))


def _float(name: str, value: float) -> float:
    if abs(value) > _MAX_FLOAT32 and not math.isinf(value):
        raise ValueError(f"{name} must be a number that fits float32, got {value!r}")
    return float(value)

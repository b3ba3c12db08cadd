# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Mission items as the fields of MAVLink messages, without pymavlink.

Messages: https://mavlink.io/en/messages/common.html; use of the fields:
https://mavlink.io/en/services/mission.html ("Frames & Positional Information").
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from msg_adapters.mission_items import (
    FRAME_GLOBAL,
    FRAME_GLOBAL_RELATIVE_ALT,
    FRAME_MISSION,
    NAV_LOITER_TIME,
    MissionItem,
)

FRAME_GLOBAL_INT = 5
FRAME_GLOBAL_RELATIVE_ALT_INT = 6
FRAME_GLOBAL_TERRAIN_ALT = 10
FRAME_GLOBAL_TERRAIN_ALT_INT = 11

_WIRE_FRAMES = {
    FRAME_GLOBAL: FRAME_GLOBAL_INT,
    FRAME_GLOBAL_RELATIVE_ALT: FRAME_GLOBAL_RELATIVE_ALT_INT,
    FRAME_GLOBAL_TERRAIN_ALT: FRAME_GLOBAL_TERRAIN_ALT_INT,
}
_FILE_FRAMES = {wire: frame for frame, wire in _WIRE_FRAMES.items()}
_DEGREE = 10**7


def item_fields(item: MissionItem, seq: int, *, mission_type: int = 0) -> dict[str, Any]:
    """Return an item as the fields of MISSION_ITEM_INT, without its target.

    Frames become their integer kin, as on the wire places are integers; a hold whose yaw is left
    open gets 0, since ArduPilot refuses a NaN there.

    Args:
        item: The item.
        seq: Its number.
        mission_type: MAV_MISSION_TYPE.

    Raises:
        ValueError: If the place is not finite or does not fit the message.
    """
    scale = 1 if item.frame == FRAME_MISSION else _DEGREE
    open_yaw = item.command == NAV_LOITER_TIME and math.isnan(item.param4)
    return {
        "seq": seq,
        "frame": _WIRE_FRAMES.get(item.frame, item.frame),
        "command": item.command,
        "current": int(seq == 0),
        "autocontinue": 1,
        "param1": float(item.param1),
        "param2": float(item.param2),
        "param3": float(item.param3),
        "param4": 0.0 if open_yaw else float(item.param4),
        "x": _integer("latitude", item.lat_deg, scale),
        "y": _integer("longitude", item.lon_deg, scale),
        "z": float(item.alt_m),
        "mission_type": mission_type,
    }


def mission_fields(items: Iterable[MissionItem], *, mission_type: int = 0) -> list[dict[str, Any]]:
    """Return the items of a mission as `item_fields`, numbered from 0."""
    return [item_fields(item, seq, mission_type=mission_type) for seq, item in enumerate(items)]


def item_from_fields(fields: Mapping[str, Any]) -> MissionItem:
    """Return the item in the fields of a MISSION_ITEM_INT: the inverse of `item_fields`."""
    frame = _FILE_FRAMES.get(fields["frame"], fields["frame"])
    scale = 1 if frame == FRAME_MISSION else _DEGREE
    return MissionItem(
        command=fields["command"],
        frame=frame,
        param1=fields["param1"],
        param2=fields["param2"],
        param3=fields["param3"],
        param4=fields["param4"],
        lat_deg=fields["x"] / scale,
        lon_deg=fields["y"] / scale,
        alt_m=fields["z"],
    )


def _integer(name: str, value: float, scale: int) -> int:
    if not abs(value * scale) < 2**31 - 1:
        raise ValueError(f"{name}: {value!r} is not allowed; a number that fits 32 bits")
    return int(round(value * scale))

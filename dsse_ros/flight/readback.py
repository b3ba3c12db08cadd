# SPDX-License-Identifier: Apache-2.0
"""Whether a mission read from a vehicle is the one that was sent to it.

Autopilots store less than the messages hold, so a healthy mission comes back changed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.flight.items import WireItem

Dialect = Literal["ardupilot", "px4"]

_FRAME_MISSION = mavlink.MAV_FRAME_MISSION
_NAV_RETURN_TO_LAUNCH = mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
_FRAMES = {
    mavlink.MAV_FRAME_GLOBAL_INT: mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT: mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
}
"""Integer frames by the others that autopilots return in their place."""
_MAX_DEGREES = 1
"""1e-7 degrees, which are lost when they are stored as floating point."""
_MAX_ALTITUDE_M = 0.02
"""ArduPilot stores centimetres."""
_MAX_PARAMETER: dict[Dialect, float] = {"ardupilot": 1.0, "px4": 1e-3}
"""ArduPilot stores whole seconds and metres."""


def difference(sent: Sequence[WireItem], read: Sequence[WireItem], dialect: Dialect) -> str | None:
    """Return what differs between two missions in one line, or None if they are the same.

    Item 0 of ArduPilot is home, which it overwrites. A return has no place. Where NaN was sent
    the autopilot has chosen.

    Args:
        sent: What was uploaded.
        read: What was downloaded.
        dialect: Whose autopilot it is.
    """
    if len(sent) != len(read):
        return f"{len(sent)} items were sent, {len(read)} read back"
    for wanted, item in list(zip(sent, read, strict=True))[1 if dialect == "ardupilot" else 0 :]:
        for name, value, other, most in _pairs(wanted, item, dialect):
            # A NaN that comes back instead of a number is a difference.
            if not abs(value - other) <= most:
                return f"item {wanted.seq}: {name} {value} was sent, {other} read back"
    return None


def _pairs(
    sent: WireItem, read: WireItem, dialect: Dialect
) -> list[tuple[str, float, float, float]]:
    """Return name, value sent, value read and greatest difference of what has to agree."""
    pairs: list[tuple[str, float, float, float]] = [
        ("seq", sent.seq, read.seq, 0),
        ("command", sent.command, read.command, 0),
    ]
    for name in ("param1", "param2", "param3", "param4"):
        value = getattr(sent, name)
        if not math.isnan(value):
            pairs.append((name, value, getattr(read, name), _MAX_PARAMETER[dialect]))
    if sent.frame != _FRAME_MISSION and sent.command != _NAV_RETURN_TO_LAUNCH:
        frames = _FRAMES.get(sent.frame, sent.frame), _FRAMES.get(read.frame, read.frame)
        pairs += [
            ("frame", *frames, 0),
            ("x", sent.x, read.x, _MAX_DEGREES),
            ("y", sent.y, read.y, _MAX_DEGREES),
            ("z", sent.z, read.z, _MAX_ALTITUDE_M),
        ]
    return pairs

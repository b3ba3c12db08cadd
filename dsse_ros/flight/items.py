# SPDX-License-Identifier: Apache-2.0
"""One mission item as it goes over the wire."""

from __future__ import annotations

import math
from dataclasses import dataclass

_INTEGERS = {
    "seq": (0, 2**16 - 1),
    "frame": (0, 2**8 - 1),
    "command": (0, 2**16 - 1),
    "current": (0, 2**8 - 1),
    "autocontinue": (0, 2**8 - 1),
    "x": (-(2**31), 2**31 - 1),
    "y": (-(2**31), 2**31 - 1),
    "mission_type": (0, 2**8 - 1),
}
_FLOATS = ("param1", "param2", "param3", "param4", "z")
_MAX_FLOAT32 = float.fromhex("0x1.fffffep+127")


@dataclass(frozen=True)
class WireItem:
    """The fields of MISSION_ITEM_INT without its target, each within the range of its type.

    https://mavlink.io/en/messages/common.html#MISSION_ITEM_INT

    Attributes:
        seq: Number of the item.
        frame: MAV_FRAME.
        command: MAV_CMD.
        current: 1 for the item to start with.
        autocontinue: 1 to go on to the next item.
        param1: As the command has it, likewise the next; float32, NaN and infinity included.
        x: Latitude in 1e-7 degrees, or parameter 5.
        y: Longitude in 1e-7 degrees, or parameter 6.
        z: Altitude in metres, or parameter 7.
        mission_type: MAV_MISSION_TYPE.

    Raises:
        ValueError: If a value does not fit its field.
    """

    seq: int
    frame: int
    command: int
    current: int = 0
    autocontinue: int = 1
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    x: int = 0
    y: int = 0
    z: float = 0.0
    mission_type: int = 0

    def __post_init__(self) -> None:
        for name, (least, most) in _INTEGERS.items():
            value = getattr(self, name)
            if not isinstance(value, int) or not least <= value <= most:
                raise ValueError(f"{name}: {value!r} is not allowed; {least} to {most}")
        for name in _FLOATS:
            value = getattr(self, name)
            if not isinstance(value, int | float):
                raise ValueError(f"{name}: {value!r} is not allowed; a number")
            if abs(value) > _MAX_FLOAT32 and not math.isinf(value):
                raise ValueError(f"{name}: {value!r} is not allowed; a number that fits float32")

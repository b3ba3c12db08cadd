# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The items and messages of the mission protocol as plain values.

https://mavlink.io/en/services/mission.html ("Message/Enum Summary").
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from enum import IntEnum
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

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


class Address(NamedTuple):
    """MAVLink's system and component id, of a sender or a target."""

    system: int
    component: int


class MissionResult(IntEnum):
    """MAV_MISSION_RESULT."""

    ACCEPTED = mavlink.MAV_MISSION_ACCEPTED
    ERROR = mavlink.MAV_MISSION_ERROR
    UNSUPPORTED_FRAME = mavlink.MAV_MISSION_UNSUPPORTED_FRAME
    UNSUPPORTED = mavlink.MAV_MISSION_UNSUPPORTED
    NO_SPACE = mavlink.MAV_MISSION_NO_SPACE
    INVALID = mavlink.MAV_MISSION_INVALID
    INVALID_PARAM1 = mavlink.MAV_MISSION_INVALID_PARAM1
    INVALID_PARAM2 = mavlink.MAV_MISSION_INVALID_PARAM2
    INVALID_PARAM3 = mavlink.MAV_MISSION_INVALID_PARAM3
    INVALID_PARAM4 = mavlink.MAV_MISSION_INVALID_PARAM4
    INVALID_PARAM5_X = mavlink.MAV_MISSION_INVALID_PARAM5_X
    INVALID_PARAM6_Y = mavlink.MAV_MISSION_INVALID_PARAM6_Y
    INVALID_PARAM7 = mavlink.MAV_MISSION_INVALID_PARAM7
    INVALID_SEQUENCE = mavlink.MAV_MISSION_INVALID_SEQUENCE
    DENIED = mavlink.MAV_MISSION_DENIED
    OPERATION_CANCELLED = mavlink.MAV_MISSION_OPERATION_CANCELLED


MISSION_FAULTS = frozenset(range(MissionResult.UNSUPPORTED_FRAME, MissionResult.INVALID_PARAM7 + 1))
"""Results that concern the mission itself: the same mission would be refused again."""


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


@dataclass(frozen=True)
class MissionRequestList:
    """Requests the number of items on a vehicle, to download them."""

    target: Address
    mission_type: int = 0


@dataclass(frozen=True)
class MissionCount:
    """The number of items that will be uploaded, or can be downloaded."""

    target: Address
    count: int
    mission_type: int = 0


@dataclass(frozen=True)
class MissionRequestInt:
    """Requests an item."""

    target: Address
    seq: int
    mission_type: int = 0


@dataclass(frozen=True)
class MissionRequest:
    """Requests an item by the deprecated message, as ArduPilot does; the reply is the same."""

    target: Address
    seq: int
    mission_type: int = 0


@dataclass(frozen=True)
class MissionItemInt:
    """An item."""

    target: Address
    item: WireItem

    @property
    def mission_type(self) -> int:
        """The item's."""
        return self.item.mission_type


@dataclass(frozen=True)
class MissionAck:
    """Ends a transfer, or reports an error; `type` is a `MissionResult` or a newer one."""

    target: Address
    type: int
    mission_type: int = 0


MissionMessage = (
    MissionRequestList
    | MissionCount
    | MissionRequestInt
    | MissionRequest
    | MissionItemInt
    | MissionAck
)
"""A message of the mission protocol."""

_NAMES: dict[type[MissionMessage], str] = {
    MissionRequestList: "MISSION_REQUEST_LIST",
    MissionCount: "MISSION_COUNT",
    MissionRequestInt: "MISSION_REQUEST_INT",
    MissionRequest: "MISSION_REQUEST",
    MissionItemInt: "MISSION_ITEM_INT",
    MissionAck: "MISSION_ACK",
}
_KINDS = {name: kind for kind, name in _NAMES.items()}
MISSION_NAMES = frozenset(_KINDS)
"""MAVLink's names of the messages of the mission protocol."""
_ITEM_FIELDS = tuple(field.name for field in fields(WireItem))


def message_name(message: MissionMessage) -> str:
    """Return MAVLink's name of a message."""
    return _NAMES[type(message)]


def message_fields(message: MissionMessage) -> dict[str, Any]:
    """Return the fields of a message by MAVLink's names, its target included."""
    own = asdict(message.item) if isinstance(message, MissionItemInt) else vars(message)
    return {
        "target_system": message.target.system,
        "target_component": message.target.component,
        **{name: value for name, value in own.items() if name != "target"},
    }


def read_message(name: str, values: Mapping[str, Any]) -> MissionMessage | None:
    """Return the message of a MAVLink name and fields, None for any that is not of the protocol.

    Args:
        name: As pymavlink's `get_type` gives it.
        values: Its fields by name; those that are not known here are ignored.
    """
    kind: Any = _KINDS.get(name)
    if kind is None:
        return None
    try:
        target = Address(int(values["target_system"]), int(values["target_component"]))
        if kind is MissionItemInt:
            return MissionItemInt(target, WireItem(**{key: values[key] for key in _ITEM_FIELDS}))
        wanted = [field.name for field in fields(kind) if field.name != "target"]
        return kind(target, **{key: int(values[key]) for key in wanted})
    except (KeyError, OverflowError, TypeError, ValueError):
        return None

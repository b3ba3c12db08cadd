# SPDX-License-Identifier: Apache-2.0
"""The messages of the mission protocol as plain values, without pymavlink.

https://mavlink.io/en/services/mission.html ("Message/Enum Summary").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from enum import IntEnum
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.flight.items import WireItem


class Address(NamedTuple):
    """Who sends a message, or whom it is for: MAVLink's system and component id."""

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
"""Results that speak of the mission itself: the same one would be refused again."""


@dataclass(frozen=True)
class MissionRequestList:
    """Asks for the number of items on a vehicle, to download them."""

    target: Address
    mission_type: int = 0


@dataclass(frozen=True)
class MissionCount:
    """Says how many items will be uploaded, or can be downloaded."""

    target: Address
    count: int
    mission_type: int = 0


@dataclass(frozen=True)
class MissionRequestInt:
    """Asks for an item."""

    target: Address
    seq: int
    mission_type: int = 0


@dataclass(frozen=True)
class MissionRequest:
    """Asks for an item in the old way, as ArduPilot does; the answer is the same."""

    target: Address
    seq: int
    mission_type: int = 0


@dataclass(frozen=True)
class MissionItemInt:
    """Brings an item."""

    target: Address
    item: WireItem

    @property
    def mission_type(self) -> int:
        """The item's."""
        return self.item.mission_type


@dataclass(frozen=True)
class MissionAck:
    """Ends a transfer, or says what is wrong; `type` is a `MissionResult` or a newer one."""

    target: Address
    type: int
    mission_type: int = 0


@dataclass(frozen=True)
class MissionClearAll:
    """Deletes all items."""

    target: Address
    mission_type: int = 0


Message = (
    MissionRequestList
    | MissionCount
    | MissionRequestInt
    | MissionRequest
    | MissionItemInt
    | MissionAck
    | MissionClearAll
)
"""A message of the mission protocol."""

_NAMES: dict[type[Message], str] = {
    MissionRequestList: "MISSION_REQUEST_LIST",
    MissionCount: "MISSION_COUNT",
    MissionRequestInt: "MISSION_REQUEST_INT",
    MissionRequest: "MISSION_REQUEST",
    MissionItemInt: "MISSION_ITEM_INT",
    MissionAck: "MISSION_ACK",
    MissionClearAll: "MISSION_CLEAR_ALL",
}
_KINDS = {name: kind for kind, name in _NAMES.items()}
_ITEM_FIELDS = tuple(field.name for field in fields(WireItem))


def message_name(message: Message) -> str:
    """Return MAVLink's name of a message."""
    return _NAMES[type(message)]


def message_fields(message: Message) -> dict[str, Any]:
    """Return the fields of a message by MAVLink's names, its target included."""
    own = asdict(message.item) if isinstance(message, MissionItemInt) else vars(message)
    return {
        "target_system": message.target.system,
        "target_component": message.target.component,
        **{name: value for name, value in own.items() if name != "target"},
    }


def read_message(name: str, values: Mapping[str, Any]) -> Message | None:
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

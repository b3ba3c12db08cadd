# SPDX-License-Identifier: Apache-2.0
"""What a vehicle says of itself and what it is told, as plain values, without pymavlink.

Names and units of the fields are MAVLink's: https://mavlink.io/en/messages/common.html. The
messages of the mission protocol are in `messages`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from dsse_ros.flight import messages
from dsse_ros.flight.messages import Address


@dataclass(frozen=True)
class Heartbeat:
    """HEARTBEAT."""

    type: int
    autopilot: int
    base_mode: int
    custom_mode: int
    system_status: int


@dataclass(frozen=True)
class SysStatus:
    """SYS_STATUS."""

    onboard_control_sensors_health: int
    battery_remaining: int


@dataclass(frozen=True)
class EkfStatus:
    """EKF_STATUS_REPORT of ArduPilot, ESTIMATOR_STATUS of PX4: the flags mean the same."""

    flags: int


@dataclass(frozen=True)
class GlobalPosition:
    """GLOBAL_POSITION_INT."""

    time_boot_ms: int
    lat: int
    lon: int
    alt: int
    relative_alt: int
    vx: int
    vy: int
    vz: int
    hdg: int


@dataclass(frozen=True)
class HomePosition:
    """HOME_POSITION."""

    latitude: int
    longitude: int
    altitude: int


@dataclass(frozen=True)
class ExtendedSysState:
    """EXTENDED_SYS_STATE."""

    landed_state: int


@dataclass(frozen=True)
class PositionTarget:
    """POSITION_TARGET_GLOBAL_INT: where the vehicle says that it is going."""

    coordinate_frame: int
    type_mask: int
    lat_int: int
    lon_int: int
    alt: float


@dataclass(frozen=True)
class MissionCurrent:
    """MISSION_CURRENT."""

    seq: int
    mission_state: int = 0


@dataclass(frozen=True)
class MissionItemReached:
    """MISSION_ITEM_REACHED."""

    seq: int


@dataclass(frozen=True)
class StatusText:
    """STATUSTEXT; severity is a MAV_SEVERITY, lower is worse."""

    severity: int
    text: str


@dataclass(frozen=True)
class CommandAck:
    """COMMAND_ACK."""

    command: int
    result: int
    target_system: int = 0
    target_component: int = 0


@dataclass(frozen=True)
class CommandLong:
    """COMMAND_LONG; parameters that are not given are 0."""

    target: Address
    command: int
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    param5: float = 0.0
    param6: float = 0.0
    param7: float = 0.0


@dataclass(frozen=True)
class SetPositionTarget:
    """SET_POSITION_TARGET_GLOBAL_INT of a position alone, its altitude above home."""

    target: Address
    lat_int: int
    lon_int: int
    alt: float


@dataclass(frozen=True)
class MissionSetCurrent:
    """MISSION_SET_CURRENT."""

    target: Address
    seq: int


Heard = (
    Heartbeat
    | SysStatus
    | EkfStatus
    | GlobalPosition
    | HomePosition
    | ExtendedSysState
    | PositionTarget
    | MissionCurrent
    | MissionItemReached
    | StatusText
    | CommandAck
    | messages.Message
)
"""What is heard from a vehicle."""

Said = Heartbeat | CommandLong | SetPositionTarget | MissionSetCurrent | messages.Message
"""What is said to a vehicle."""

_HEARD: dict[str, type] = {
    "HEARTBEAT": Heartbeat,
    "SYS_STATUS": SysStatus,
    "EKF_STATUS_REPORT": EkfStatus,
    "ESTIMATOR_STATUS": EkfStatus,
    "GLOBAL_POSITION_INT": GlobalPosition,
    "HOME_POSITION": HomePosition,
    "EXTENDED_SYS_STATE": ExtendedSysState,
    "POSITION_TARGET_GLOBAL_INT": PositionTarget,
    "MISSION_CURRENT": MissionCurrent,
    "MISSION_ITEM_REACHED": MissionItemReached,
    "STATUSTEXT": StatusText,
    "COMMAND_ACK": CommandAck,
}
_FIELDS = {kind: tuple(field.name for field in fields(kind)) for kind in _HEARD.values()}

HEARD_NAMES = frozenset(_HEARD) | {
    "MISSION_REQUEST_LIST",
    "MISSION_COUNT",
    "MISSION_REQUEST_INT",
    "MISSION_REQUEST",
    "MISSION_ITEM_INT",
    "MISSION_ACK",
    "MISSION_CLEAR_ALL",
}
"""MAVLink's names of what is understood here; anything else need not be decoded."""

_FRAME_GLOBAL_RELATIVE_ALT_INT = 6
_POSITION_ONLY = 0b110111111000
_UNUSED = ("vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate")


def read(name: str, values: Mapping[str, Any]) -> Heard | None:
    """Return the message of a MAVLink name and fields, None for one that is not understood.

    Args:
        name: As pymavlink's `get_type` gives it.
        values: Its fields by name; those that are not known here are ignored.
    """
    kind = _HEARD.get(name)
    if kind is None:
        return messages.read_message(name, values)
    try:
        # Fields of MAVLink 2 that are missing have the default of their class.
        return kind(**{key: values[key] for key in _FIELDS[kind] if key in values})
    except TypeError:
        return None


def write(said: Said) -> tuple[str, dict[str, Any]]:
    """Return MAVLink's name and fields of a message to a vehicle, its target included."""
    if isinstance(said, Heartbeat):
        return "HEARTBEAT", {**vars(said), "mavlink_version": 3}
    target = {"target_system": said.target.system, "target_component": said.target.component}
    if isinstance(said, MissionSetCurrent):
        return "MISSION_SET_CURRENT", {**target, "seq": said.seq}
    if isinstance(said, CommandLong):
        own = {key: value for key, value in vars(said).items() if key != "target"}
        return "COMMAND_LONG", {**target, "confirmation": 0, **own}
    if isinstance(said, SetPositionTarget):
        return "SET_POSITION_TARGET_GLOBAL_INT", {
            **target,
            "time_boot_ms": 0,
            "coordinate_frame": _FRAME_GLOBAL_RELATIVE_ALT_INT,
            "type_mask": _POSITION_ONLY,
            "lat_int": said.lat_int,
            "lon_int": said.lon_int,
            "alt": said.alt,
            **dict.fromkeys(_UNUSED, 0.0),
        }
    return messages.message_name(said), messages.message_fields(said)


def degrees_e7(degrees: float) -> int:
    """Return an angle as MAVLink has it on the wire, in 1e-7 degrees.

    Raises:
        ValueError: If it is not finite or does not fit.
    """
    if not (math.isfinite(degrees) and abs(degrees) <= 180):
        raise ValueError(f"{degrees!r} is not allowed; -180 to 180")
    return int(round(degrees * 1e7))

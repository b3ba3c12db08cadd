# SPDX-License-Identifier: Apache-2.0
"""What a vehicle says of itself and what it is told, as plain values, without pymavlink.

Names and units of the fields are MAVLink's: https://mavlink.io/en/messages/common.html. The
messages of the mission protocol are in `messages`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

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
    onboard_control_sensors_enabled: int = 0


@dataclass(frozen=True)
class BatteryStatus:
    """BATTERY_STATUS."""

    charge_state: int = 0


@dataclass(frozen=True)
class EkfStatus:
    """EKF_STATUS_REPORT of ArduPilot."""

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
    """STATUSTEXT; severity is a MAV_SEVERITY, lower is worse; `status_texts` has the others."""

    severity: int
    text: str
    id: int = 0
    chunk_seq: int = 0


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
    """SET_POSITION_TARGET_GLOBAL_INT: a place, and the velocity to pass it with.

    Attributes:
        target: The vehicle's autopilot.
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_m: Altitude above home, or above mean sea level.
        velocity_mps: Velocity to north and east, None to stop there.
        above_sea: Whether the altitude is above mean sea level.
    """

    target: Address
    lat_deg: float
    lon_deg: float
    alt_m: float
    velocity_mps: tuple[float, float] | None = None
    above_sea: bool = False


@dataclass(frozen=True)
class MissionSetCurrent:
    """MISSION_SET_CURRENT."""

    target: Address
    seq: int


Heard = (
    Heartbeat
    | SysStatus
    | BatteryStatus
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
    "BATTERY_STATUS": BatteryStatus,
    "EKF_STATUS_REPORT": EkfStatus,
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

_MAVLINK_VERSION = 3
_ABOVE_SEA = mavlink.MAV_FRAME_GLOBAL_INT
_ABOVE_HOME = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
_NO_VELOCITY = (
    mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VZ_IGNORE
)
_POSITION = (
    _NO_VELOCITY
    | mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
)

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
        return "HEARTBEAT", {**vars(said), "mavlink_version": _MAVLINK_VERSION}
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
            "coordinate_frame": _ABOVE_SEA if said.above_sea else _ABOVE_HOME,
            "type_mask": _POSITION if said.velocity_mps is None else _POSITION & ~_NO_VELOCITY,
            "lat_int": _degrees_e7(said.lat_deg),
            "lon_int": _degrees_e7(said.lon_deg),
            "alt": said.alt_m,
            **dict(zip(("vx", "vy"), said.velocity_mps or (0.0, 0.0), strict=True)),
            **dict.fromkeys(("vz", "afx", "afy", "afz", "yaw", "yaw_rate"), 0.0),
        }
    return messages.message_name(said), messages.message_fields(said)


def _degrees_e7(degrees: float) -> int:
    if not abs(degrees) <= 180:
        raise ValueError(f"{degrees!r} is not allowed; -180 to 180")
    return round(degrees * 1e7)

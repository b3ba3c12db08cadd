# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""MAVLink's messages from and to a vehicle as plain values, and whether their values are valid.

Names and units of the fields are MAVLink's: https://mavlink.io/en/messages/common.html. The
messages of the mission protocol are in `mission_messages`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.mavlink.mission_messages import (
    MISSION_NAMES,
    Address,
    MissionMessage,
    message_fields,
    message_name,
    read_message,
)

NO_POSITION = (
    mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
"""Bits of PositionTarget.type_mask for a target without a position."""
MAX_ALT_M = 100_000.0
"""Greatest valid altitude, and depth, relative to the sea or home."""


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
class GpsRaw:
    """GPS_RAW_INT: altitudes in mm; without MAVLink 2 the one above the ellipsoid is 0."""

    fix_type: int
    alt: int
    alt_ellipsoid: int = 0


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
    """POSITION_TARGET_GLOBAL_INT: the position to which the vehicle flies."""

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
    """STATUSTEXT; severity is a MAV_SEVERITY, lower is worse; the others are for `StatusTexts`."""

    severity: int
    text: str
    id: int = 0
    chunk_seq: int = 0


@dataclass(frozen=True)
class Event:
    """EVENT; log_levels has the external one in its lower half, lower is worse."""

    id: int
    log_levels: int
    arguments: bytes


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
    """SET_POSITION_TARGET_GLOBAL_INT: a position, and the velocity to pass it with.

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


Incoming = (
    Heartbeat
    | SysStatus
    | BatteryStatus
    | EkfStatus
    | GlobalPosition
    | GpsRaw
    | HomePosition
    | ExtendedSysState
    | PositionTarget
    | MissionCurrent
    | MissionItemReached
    | StatusText
    | Event
    | CommandAck
    | MissionMessage
)
"""A message from a vehicle."""

Outgoing = Heartbeat | CommandLong | SetPositionTarget | MissionSetCurrent | MissionMessage
"""A message to a vehicle."""

_KINDS: dict[str, type] = {
    "HEARTBEAT": Heartbeat,
    "SYS_STATUS": SysStatus,
    "BATTERY_STATUS": BatteryStatus,
    "EKF_STATUS_REPORT": EkfStatus,
    "GLOBAL_POSITION_INT": GlobalPosition,
    "GPS_RAW_INT": GpsRaw,
    "HOME_POSITION": HomePosition,
    "EXTENDED_SYS_STATE": ExtendedSysState,
    "POSITION_TARGET_GLOBAL_INT": PositionTarget,
    "MISSION_CURRENT": MissionCurrent,
    "MISSION_ITEM_REACHED": MissionItemReached,
    "STATUSTEXT": StatusText,
    "EVENT": Event,
    "COMMAND_ACK": CommandAck,
}
_FIELDS = {kind: tuple(field.name for field in fields(kind)) for kind in _KINDS.values()}

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

INCOMING_NAMES = frozenset(_KINDS) | MISSION_NAMES
"""MAVLink's names of the incoming messages; no other needs to be decoded."""


def read(name: str, values: Mapping[str, Any]) -> Incoming | None:
    """Return the message of a MAVLink name and fields, None for one that is not an `Incoming`.

    Args:
        name: As pymavlink's `get_type` gives it.
        values: Its fields by name; those that are not known here are ignored.
    """
    kind = _KINDS.get(name)
    if kind is None:
        return read_message(name, values)
    try:
        # A missing field of MAVLink 2 has the default of its class.
        return kind(**{key: values[key] for key in _FIELDS[kind] if key in values})
    except TypeError:
        return None


def write(message: Outgoing) -> tuple[str, dict[str, Any]]:
    """Return MAVLink's name and fields of a message to a vehicle, its target included.

    Raises:
        ValueError: If a coordinate of a setpoint is not allowed.
    """
    if isinstance(message, Heartbeat):
        return "HEARTBEAT", {**vars(message), "mavlink_version": _MAVLINK_VERSION}
    target = {"target_system": message.target.system, "target_component": message.target.component}
    if isinstance(message, MissionSetCurrent):
        return "MISSION_SET_CURRENT", {**target, "seq": message.seq}
    if isinstance(message, CommandLong):
        own = {key: value for key, value in vars(message).items() if key != "target"}
        return "COMMAND_LONG", {**target, "confirmation": 0, **own}
    if isinstance(message, SetPositionTarget):
        return "SET_POSITION_TARGET_GLOBAL_INT", {
            **target,
            "time_boot_ms": 0,
            "coordinate_frame": _ABOVE_SEA if message.above_sea else _ABOVE_HOME,
            "type_mask": _POSITION if message.velocity_mps is None else _POSITION & ~_NO_VELOCITY,
            "lat_int": _degrees_e7("lat_deg", message.lat_deg),
            "lon_int": _degrees_e7("lon_deg", message.lon_deg),
            "alt": message.alt_m,
            **dict(zip(("vx", "vy"), message.velocity_mps or (0.0, 0.0), strict=True)),
            **dict.fromkeys(("vz", "afx", "afy", "afz", "yaw", "yaw_rate"), 0.0),
        }
    return message_name(message), message_fields(message)


def is_valid(message: Incoming) -> bool:
    """Return whether the coordinates in a message, if it has any, are on Earth and finite."""
    match message:
        case GlobalPosition(_, lat, lon, alt, relative_alt):
            return _is_position(lat, lon, alt * 1e-3) and abs(relative_alt * 1e-3) <= MAX_ALT_M
        case HomePosition(lat, lon, alt):
            return _is_position(lat, lon, alt * 1e-3)
        case PositionTarget(_, type_mask, lat, lon, alt_m):
            return bool(type_mask & NO_POSITION) or _is_position(lat, lon, alt_m)
    return True


def _is_position(lat_e7: int, lon_e7: int, alt_m: float) -> bool:
    # NaN is not within any limits.
    return abs(lat_e7) <= 90e7 and abs(lon_e7) <= 180e7 and abs(alt_m) <= MAX_ALT_M


def _degrees_e7(name: str, degrees: float) -> int:
    if not abs(degrees) <= 180:
        raise ValueError(f"{name}: {degrees!r} is not allowed; -180 to 180")
    return round(degrees * 1e7)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""MAVLink's messages from and to a vehicle: pymavlink's classes by short names, and their checks.

Names and units of the fields are MAVLink's: https://mavlink.io/en/messages/common.html.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Any, NamedTuple, get_args

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.mavlink.events import EventMessage

NO_POSITION = (
    mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
"""Bits of PositionTarget.type_mask for a target without a position."""
MAX_ALT_M = 100_000.0
"""Greatest valid altitude, and depth, relative to the sea or home."""
MISSION_FAULTS = frozenset(
    range(mavlink.MAV_MISSION_UNSUPPORTED_FRAME, mavlink.MAV_MISSION_INVALID_PARAM7 + 1)
)
"""Results that concern the mission itself: the same mission would be refused again."""

Heartbeat = mavlink.MAVLink_heartbeat_message
SysStatus = mavlink.MAVLink_sys_status_message
BatteryStatus = mavlink.MAVLink_battery_status_message
AutopilotVersion = mavlink.MAVLink_autopilot_version_message
EkfStatus = mavlink.MAVLink_ekf_status_report_message
"""ArduPilot's position estimate."""
EstimatorStatus = mavlink.MAVLink_estimator_status_message
"""PX4's, with the same flags."""
Attitude = mavlink.MAVLink_attitude_message
GlobalPosition = mavlink.MAVLink_global_position_int_message
GpsRaw = mavlink.MAVLink_gps_raw_int_message
Wind = mavlink.MAVLink_wind_message
"""ArduPilot's estimate: where it comes from."""
WindCov = mavlink.MAVLink_wind_cov_message
"""PX4's estimate: where it blows to."""
HomePosition = mavlink.MAVLink_home_position_message
ExtendedSysState = mavlink.MAVLink_extended_sys_state_message
PositionTarget = mavlink.MAVLink_position_target_global_int_message
MissionItemReached = mavlink.MAVLink_mission_item_reached_message
CommandAck = mavlink.MAVLink_command_ack_message
CommandLong = mavlink.MAVLink_command_long_message
ParamRequestRead = mavlink.MAVLink_param_request_read_message
ParamValue = mavlink.MAVLink_param_value_message
MissionSetCurrent = mavlink.MAVLink_mission_set_current_message
MissionRequestList = mavlink.MAVLink_mission_request_list_message
MissionCount = mavlink.MAVLink_mission_count_message
MissionRequestInt = mavlink.MAVLink_mission_request_int_message
MissionRequest = mavlink.MAVLink_mission_request_message
"""Deprecated, but what ArduPilot sends; the reply is the same."""
MissionItemInt = mavlink.MAVLink_mission_item_int_message
MissionAck = mavlink.MAVLink_mission_ack_message


class MissionCurrent(mavlink.MAVLink_mission_current_message):
    """MISSION_CURRENT with its extensions, which pymavlink leaves out.

    An autopilot makes `mission_id` of the content of its mission; 0 if it makes none.
    """

    fieldnames = (
        "seq", "total", "mission_state", "mission_mode", "mission_id", "fence_id",
        "rally_points_id",
    )  # fmt: skip
    ordered_fieldnames = fieldnames
    fieldtypes = ("uint16_t", "uint16_t", "uint8_t", "uint8_t", "uint32_t", "uint32_t", "uint32_t")
    orders = tuple(range(7))
    lengths = (1,) * 7
    array_lengths = (0,) * 7
    unpacker = struct.Struct("<HHBBIII")

    def __init__(
        self,
        seq: int,
        total: int = 0,
        mission_state: int = 0,
        mission_mode: int = 0,
        mission_id: int = 0,
        fence_id: int = 0,
        rally_points_id: int = 0,
    ) -> None:
        super().__init__(seq, total, mission_state, mission_mode)
        self._fieldnames = self.fieldnames
        self.mission_id = mission_id
        self.fence_id, self.rally_points_id = fence_id, rally_points_id

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """Return the frame."""
        payload = self.unpacker.pack(*(getattr(self, name) for name in self.fieldnames))
        return bytes(self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1))


class Address(NamedTuple):
    """MAVLink's system and component id, of a sender or a target."""

    system: int
    component: int


class StatusText(NamedTuple):
    """A status text joined from its STATUSTEXT messages.

    Attributes:
        severity: MAV_SEVERITY, lower is worse.
        text: The whole text.
    """

    severity: int
    text: str


@dataclass(frozen=True)
class SetPositionTarget:
    """A position, and the velocity to pass it with, before it is SET_POSITION_TARGET_GLOBAL_INT.

    Attributes:
        target: The vehicle's autopilot.
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_amsl_m: Altitude above mean sea level.
        velocity_mps: Velocity to north and east, None to stop there.
        repositions: Whether it is MAV_CMD_DO_REPOSITION.
    """

    target: Address
    lat_deg: float
    lon_deg: float
    alt_amsl_m: float
    velocity_mps: tuple[float, float] | None = None
    repositions: bool = False

    def message(self) -> mavlink.MAVLink_message:
        """Return it as MAVLink has it.

        Raises:
            ValueError: If a coordinate is not allowed.
        """
        if self.repositions:
            return mavlink.MAVLink_command_int_message(
                *self.target,
                mavlink.MAV_FRAME_GLOBAL,
                mavlink.MAV_CMD_DO_REPOSITION,
                0,
                0,
                # The speed, the mode, the radius and its sense as they are.
                *(-1.0, 0.0, 0.0, math.nan),
                _degrees_e7("lat_deg", self.lat_deg),
                _degrees_e7("lon_deg", self.lon_deg),
                self.alt_amsl_m,
            )
        return mavlink.MAVLink_set_position_target_global_int_message(
            0,
            *self.target,
            mavlink.MAV_FRAME_GLOBAL_INT,
            _POSITION if self.velocity_mps is None else _POSITION & ~_NO_VELOCITY,
            _degrees_e7("lat_deg", self.lat_deg),
            _degrees_e7("lon_deg", self.lon_deg),
            self.alt_amsl_m,
            *(self.velocity_mps or (0.0, 0.0)),
            *(0.0,) * 6,
        )


MissionMessage = (
    MissionRequestList
    | MissionCount
    | MissionRequestInt
    | MissionRequest
    | MissionItemInt
    | MissionAck
)
"""A message of the mission protocol: https://mavlink.io/en/services/mission.html."""
INCOMING: tuple[Any, ...] = (
    Heartbeat,
    SysStatus,
    AutopilotVersion,
    BatteryStatus,
    EkfStatus,
    EstimatorStatus,
    Attitude,
    GlobalPosition,
    GpsRaw,
    Wind,
    WindCov,
    HomePosition,
    ExtendedSysState,
    PositionTarget,
    MissionCurrent,
    MissionItemReached,
    mavlink.MAVLink_statustext_message,
    EventMessage,
    CommandAck,
    ParamValue,
    *get_args(MissionMessage),
)
"""Types of the messages from a vehicle; no other needs to be decoded."""
Incoming = mavlink.MAVLink_message | StatusText
"""A message from a vehicle."""
Outgoing = (
    Heartbeat
    | CommandLong
    | ParamRequestRead
    | SetPositionTarget
    | MissionSetCurrent
    | MissionMessage
)
"""A message to a vehicle."""

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


def enum_name(enum: str, number: int, prefix: str = "") -> str:
    """Return the name of a MAVLink enumeration's entry, or the number if it has none.

    Args:
        enum: Name of the enumeration.
        number: The entry.
        prefix: What the names of its entries begin with, if not the name of the enumeration.
    """
    entry = mavlink.enums[enum].get(number)
    if entry is None or entry.name.endswith("_ENUM_END"):
        return str(number)
    return entry.name.removeprefix(prefix or f"{enum}_")


def command_long(target: Address, command: int, *parameters: float) -> mavlink.MAVLink_message:
    """Return a COMMAND_LONG; parameters that are not given are 0."""
    missing = (0.0,) * (7 - len(parameters))
    return CommandLong(*target, command, 0, *parameters, *missing)


def is_valid(message: mavlink.MAVLink_message) -> bool:
    """Return whether the coordinates in a message, if it has any, are on Earth and finite."""
    match message:
        case GlobalPosition(lat=lat, lon=lon, alt=alt, relative_alt=relative_alt):
            return _is_position(lat, lon, alt * 1e-3) and abs(relative_alt * 1e-3) <= MAX_ALT_M
        case HomePosition(latitude=lat, longitude=lon, altitude=alt):
            return _is_position(lat, lon, alt * 1e-3)
        case PositionTarget(type_mask=type_mask, lat_int=lat, lon_int=lon, alt=alt_m):
            return bool(type_mask & NO_POSITION) or _is_position(lat, lon, alt_m)
    return True


def _is_position(lat_e7: int, lon_e7: int, alt_m: float) -> bool:
    # NaN is not within any limits.
    return abs(lat_e7) <= 90e7 and abs(lon_e7) <= 180e7 and abs(alt_m) <= MAX_ALT_M


def _degrees_e7(name: str, degrees: float) -> int:
    if not abs(degrees) <= 180:
        raise ValueError(f"{name} must be -180 to 180, got {degrees!r}")
    return round(degrees * 1e7)

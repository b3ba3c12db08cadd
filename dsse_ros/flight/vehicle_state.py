# SPDX-License-Identifier: Apache-2.0
"""What a vehicle says of itself, put together from its messages."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.flight.mavlink_messages import (
    NO_POSITION,
    BatteryStatus,
    EkfStatus,
    ExtendedSysState,
    GlobalPosition,
    Heartbeat,
    HomePosition,
    Incoming,
    MissionCurrent,
    MissionItemReached,
    PositionTarget,
    StatusText,
    SysStatus,
)
from dsse_ros.flight.modes import mode_name
from dsse_ros.flight.upload import Dialect

_ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
_STATE_ACTIVE = mavlink.MAV_STATE_ACTIVE
_CRITICAL = frozenset({mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY})
_POSITION_GOOD = mavlink.EKF_POS_HORIZ_ABS
_POSITION_CONSTANT = mavlink.EKF_CONST_POS_MODE
_PREARM_CHECK = mavlink.MAV_SYS_STATUS_PREARM_CHECK
_LANDED_UNKNOWN = mavlink.MAV_LANDED_STATE_UNDEFINED
_AIRBORNE = frozenset(
    {
        mavlink.MAV_LANDED_STATE_IN_AIR,
        mavlink.MAV_LANDED_STATE_TAKEOFF,
        mavlink.MAV_LANDED_STATE_LANDING,
    }
)
_MAX_HEADING = 36_000
_GLOBAL_FRAMES = frozenset({mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT})
_RELATIVE_FRAMES = frozenset(
    {mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}
)
_FENCE = mavlink.MAV_SYS_STATUS_GEOFENCE
_BATTERY_FAILSAFE = frozenset(
    {
        mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL,
        mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY,
        mavlink.MAV_BATTERY_CHARGE_STATE_FAILED,
    }
)
"""At these PX4 acts; at LOW it only warns."""
_SENSORS = {
    mavlink.MAV_SYS_STATUS_AHRS: "ekf",
    mavlink.MAV_SYS_STATUS_SENSOR_GPS: "gps",
    mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS: "motors",
}
"""What may be the cause of a failsafe, by the bit of SYS_STATUS that says that it is not well."""
_FAILSAFE_TEXTS = (
    ("battery", ("is low", "failsafe", "low battery", "is critical")),
    ("gcs", ("failsafe",)),
    ("radio", ("failsafe",)),
    ("ekf", ("failsafe",)),
)
_CLEARED = "cleared"
_CHECKS = ("prearm:", "arm:", "preflight fail:")
"""How texts begin that say why it cannot be armed."""
_REPEATED_S = 35.0
"""They are repeated as long as they are true: by ArduPilot every 30 s."""
_MISSION_COMPLETE = mavlink.MISSION_STATE_COMPLETE


@dataclass(frozen=True)
class VehicleState:
    """What a vehicle says of itself; numbers that are not known are NaN.

    Attributes:
        connected: Whether heartbeats come.
        ready: Whether it knows where it is and its checks before arming are passed.
        armed: Whether its motors turn, or may.
        mode: Name of its flight mode: see `modes`; empty if not known.
        flying: Whether it is off the ground.
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_amsl_m: Altitude above mean sea level.
        alt_m: Altitude above home.
        heading_deg: Where its nose points, clockwise from north.
        speed_mps: Over ground.
        climb_mps: Upwards.
        home: Latitude, longitude in degrees and altitude above mean sea level.
        battery: 0 (empty) to 1.
        fenced: Whether it says that a geofence of its own is enabled.
        failsafe: Empty, or which one has struck: `battery`, `gcs`, `radio`, `ekf`, `gps`, `motors`,
            `offboard` (see `pilot`), or `critical` if it does not say which.
        item_current: Number of the mission item that is flown, or would be; -1 if none.
        item_reached: Number of the item reached last; -1 if none.
        mission_over: Whether it says that the mission has been flown to its end.
        target: Where it says that it is going: latitude, longitude in degrees, metres above mean
            sea level.
        target_s: Our time of that.
        boot_s: Its own clock at its last position, which may go faster than ours.
        heard_s: Our time of its last heartbeat.
        position_s: Our time of its last position.
    """

    connected: bool = False
    ready: bool = False
    armed: bool = False
    mode: str = ""
    flying: bool = False
    lat_deg: float = math.nan
    lon_deg: float = math.nan
    alt_amsl_m: float = math.nan
    alt_m: float = math.nan
    heading_deg: float = math.nan
    speed_mps: float = math.nan
    climb_mps: float = math.nan
    home: tuple[float, float, float] | None = None
    battery: float = math.nan
    fenced: bool = False
    failsafe: str = ""
    item_current: int = -1
    item_reached: int = -1
    mission_over: bool = False
    target: tuple[float, float, float] | None = None
    target_s: float = -math.inf
    boot_s: float = math.nan
    heard_s: float = -math.inf
    position_s: float = -math.inf
    # What it takes to know some of the above.
    _position_good: bool = False
    _checks_passed: bool = False
    _landed_state: int = _LANDED_UNKNOWN
    _alarm: str = ""
    _battery_low: bool = False
    _unwell: str = ""
    _complaints: tuple[tuple[str, float], ...] = ()

    @property
    def unready(self) -> str:
        """What it has said lately of why it is not ready; empty if it is, or has not said."""
        return "; ".join(text for text, _ in self._complaints)

    @property
    def has_position(self) -> bool:
        """Whether its place is known."""
        return math.isfinite(self.lat_deg) and math.isfinite(self.alt_m)


def observe(state: VehicleState, heard: Incoming, now: float, dialect: Dialect) -> VehicleState:
    """Return the state after a message of the vehicle.

    Args:
        state: What was known before.
        heard: The message; one that says nothing of the state changes nothing.
        now: Our time in seconds.
        dialect: Whose autopilot it is.
    """
    match heard:
        case Heartbeat():
            return _heartbeat(state, heard, now, dialect)
        case GlobalPosition():
            return _position(state, heard, now)
        case SysStatus():
            return _sys_status(state, heard, dialect)
        case BatteryStatus(charge):
            return _failsafe(replace(state, _battery_low=charge in _BATTERY_FAILSAFE))
        case EkfStatus(flags):
            good = bool(flags & _POSITION_GOOD) and not flags & _POSITION_CONSTANT
            return _ready(replace(state, _position_good=good), good and state._checks_passed)
        case ExtendedSysState(landed):
            return _flying(replace(state, _landed_state=landed))
        case HomePosition(lat, lon, alt):
            return replace(state, home=(lat * 1e-7, lon * 1e-7, alt * 1e-3))
        case PositionTarget():
            return replace(state, target=_target(state, heard), target_s=now)
        case MissionCurrent(seq, mission_state):
            return replace(state, item_current=seq, mission_over=mission_state == _MISSION_COMPLETE)
        case MissionItemReached(seq):
            return replace(state, item_reached=seq)
        case StatusText(_, text):
            return _status_text(state, text, now, dialect)
    return state


def without_link(state: VehicleState) -> VehicleState:
    """Return the state of a vehicle that is not heard any more: the last one that is known."""
    return replace(state, connected=False, ready=False)


def _sys_status(state: VehicleState, heard: SysStatus, dialect: Dialect) -> VehicleState:
    health, remaining = heard.onboard_control_sensors_health, heard.battery_remaining
    passed = bool(health & _PREARM_CHECK)
    # PX4 has looked at its position estimate, of which it says CONST_POS_MODE wherever it rests.
    placed = state.has_position if dialect == "px4" else state._position_good
    missing = heard.onboard_control_sensors_enabled & ~health
    state = _failsafe(
        replace(
            state,
            battery=remaining / 100 if 0 <= remaining <= 100 else math.nan,
            fenced=bool(heard.onboard_control_sensors_enabled & _FENCE),
            _checks_passed=passed,
            _unwell=next((name for bit, name in _SENSORS.items() if missing & bit), ""),
        )
    )
    return _ready(state, passed and placed)


def _ready(state: VehicleState, ready: bool) -> VehicleState:
    return replace(state, ready=ready, _complaints=() if ready else state._complaints)


def _failsafe(state: VehicleState) -> VehicleState:
    """Name the failsafe that has struck, if one has, by what else is known."""
    if not state.failsafe:
        return state
    battery = "battery" if state._battery_low else ""
    return replace(state, failsafe=state._alarm or battery or state._unwell or "critical")


def _heartbeat(state: VehicleState, heard: Heartbeat, now: float, dialect: Dialect) -> VehicleState:
    critical = heard.system_status in _CRITICAL
    armed = bool(heard.base_mode & _ARMED)
    known = replace(
        state,
        connected=True,
        heard_s=now,
        armed=armed,
        mode=mode_name(heard.custom_mode, dialect),
        failsafe="critical" if critical else "",
        _alarm=state._alarm if critical else "",
    )
    known = _failsafe(known)
    if state._landed_state == _LANDED_UNKNOWN:
        # It has not said more exactly yet.
        return replace(known, flying=armed and heard.system_status >= _STATE_ACTIVE)
    return _flying(known)


def _flying(state: VehicleState) -> VehicleState:
    if state._landed_state == _LANDED_UNKNOWN:
        return state
    return replace(state, flying=state.armed and state._landed_state in _AIRBORNE)


def _position(state: VehicleState, heard: GlobalPosition, now: float) -> VehicleState:
    if heard.lat == 0 and heard.lon == 0:
        # So it says when it does not know.
        return state
    heading_deg = heard.hdg / 100 if heard.hdg <= _MAX_HEADING else math.nan
    return replace(
        state,
        lat_deg=heard.lat * 1e-7,
        lon_deg=heard.lon * 1e-7,
        alt_amsl_m=heard.alt * 1e-3,
        alt_m=heard.relative_alt * 1e-3,
        heading_deg=heading_deg,
        speed_mps=math.hypot(heard.vx, heard.vy) / 100,
        climb_mps=-heard.vz / 100,
        boot_s=heard.time_boot_ms * 1e-3,
        position_s=now,
    )


def _target(state: VehicleState, heard: PositionTarget) -> tuple[float, float, float] | None:
    if heard.type_mask & NO_POSITION:
        return None
    alt_amsl_m = heard.alt
    if heard.coordinate_frame in _RELATIVE_FRAMES:
        alt_amsl_m += state.alt_amsl_m - state.alt_m
    elif heard.coordinate_frame not in _GLOBAL_FRAMES:
        return None
    return heard.lat_int * 1e-7, heard.lon_int * 1e-7, alt_amsl_m


def _status_text(state: VehicleState, text: str, now: float, dialect: Dialect) -> VehicleState:
    lower = text.lower()
    if lower.startswith(_CHECKS):
        complaints = dict(state._complaints) | {text: now}
        latest = [(one, said_s) for one, said_s in complaints.items() if now - said_s < _REPEATED_S]
        return replace(state, _complaints=tuple(latest))
    for name, signs in _FAILSAFE_TEXTS:
        if name in lower and any(sign in lower for sign in signs):
            alarm = "" if _CLEARED in lower else name
            if dialect == "px4":
                # It says the same where it only warns.
                return _failsafe(replace(state, _alarm=alarm))
            return replace(state, failsafe=alarm, _alarm=alarm)
    return state

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state that a vehicle reports in its messages, and the requests for these."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.autopilots import Autopilot
from dsse_ros.flight.identity import (
    Identity,
    unidentified,
    with_heartbeat,
    with_position,
    with_version,
    without_uid,
)
from dsse_ros.mavlink.events import EventMessage
from dsse_ros.mavlink.messages import (
    NO_POSITION,
    Address,
    Attitude,
    AutopilotVersion,
    BatteryStatus,
    EkfStatus,
    ExtendedSysState,
    GlobalPosition,
    GpsRaw,
    Heartbeat,
    HomePosition,
    Incoming,
    MissionCurrent,
    MissionItemReached,
    Outgoing,
    ParamRequestRead,
    ParamValue,
    PositionTarget,
    StatusText,
    SysStatus,
    command_long,
)

_CRITICAL = frozenset({mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY})
_LANDED_UNKNOWN = mavlink.MAV_LANDED_STATE_UNDEFINED
_AIRBORNE = frozenset(
    {
        mavlink.MAV_LANDED_STATE_IN_AIR,
        mavlink.MAV_LANDED_STATE_TAKEOFF,
        mavlink.MAV_LANDED_STATE_LANDING,
    }
)
_NOWHERE = 100_000
"""Latitude and longitude in 1e-7 degrees up to which there is no place."""
_MAX_HEADING = 36_000
_GLOBAL_FRAMES = frozenset({mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT})
_RELATIVE_FRAMES = frozenset(
    {mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}
)
_SENSORS = {
    mavlink.MAV_SYS_STATUS_AHRS: "ekf",
    mavlink.MAV_SYS_STATUS_SENSOR_GPS: "gps",
    mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS: "motors",
}
"""Possible causes of a failsafe, by the bit of SYS_STATUS that reports them unhealthy."""
_NO_FIX = mavlink.GPS_FIX_TYPE_2D_FIX
"""GPS_FIX_TYPE up to which no altitude is known."""
_CLEARED = "cleared"
_ALARM_S = 5.0
"""How long a text about a failsafe counts before the heartbeats report that one is active."""
_UNKNOWN_TOTAL = 2**16 - 1
"""MISSION_CURRENT.total of an autopilot that does not report it."""
_UNTIL_THE_NEXT_REPORT = math.inf

_RATE_HZ = 1.0
_MISSED = 3
_GRACE_S = 1.0
_REQUEST_AGAIN_S = 2.0
_ASK_AGAIN_S = 10.0
_VERSION_ASKS = 4
_BY_NAME = -1


@dataclass(frozen=True)
class VehicleState:
    """What a vehicle reports; numbers that are not known are NaN.

    Attributes:
        identity: Which vehicle it is.
        connected: Whether heartbeats come.
        ready: Whether its position is good and its pre-arm checks are passed.
        armed: Whether its motors turn, or may.
        disarmed_beats: Number of the last heartbeats that were not armed.
        problem: Why it must not be flown, as it is another kind of vehicle; empty if it may be.
        mode: Name of its flight mode: see `Autopilot`; empty if not known.
        flying: Whether it is off the ground.
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_amsl_m: Altitude above mean sea level.
        alt_m: Altitude above home.
        geoid_m: Height of mean sea level above the WGS84 ellipsoid there, as its GPS reports it.
        heading_deg: Where its nose points, clockwise from north.
        roll_rad: How far its right side is down; 0 until it is known.
        pitch_rad: How far its nose is up; 0 until it is known.
        speed_mps: Over ground.
        climb_mps: Upwards.
        home: Latitude, longitude in degrees and altitude above mean sea level.
        return_alt_m: Altitude above home to which it climbs before it returns.
        return_climb_m: Height that it climbs at least before it returns.
        return_end_m: Altitude above home at which it circles over home; negative for any.
        battery: 0 (empty) to 1.
        fenced: Whether a geofence of its own is enabled.
        failsafe: Empty, or which one is active: `battery`, `gcs`, `radio`, `ekf`, `gps`, `motors`,
            `fence`, `offboard` (see `ModeWatch`), or `critical` if it does not report which.
        item_current: Number of the mission item that is flown, or would be; -1 if none.
        item_total: Number of the items of its mission, without home; -1 if not known.
        item_s: Our time of the last report of these.
        item_reached: Number of the item reached last; -1 if none.
        mission_over: Whether it reports that the mission has been flown to its end.
        target: Where it reports to be going: latitude, longitude in degrees, metres above mean sea
            level.
        target_s: Our time of that.
        boot_s: Its own clock at its last position, which may go faster than ours.
        heard_s: Our time of its last heartbeat.
        position_s: Our time of its last position.
    """

    identity: Identity = Identity()
    connected: bool = False
    ready: bool = False
    armed: bool = False
    disarmed_beats: int = 0
    problem: str = ""
    mode: str = ""
    flying: bool = False
    lat_deg: float = math.nan
    lon_deg: float = math.nan
    alt_amsl_m: float = math.nan
    alt_m: float = math.nan
    geoid_m: float = math.nan
    heading_deg: float = math.nan
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    speed_mps: float = math.nan
    climb_mps: float = math.nan
    home: tuple[float, float, float] | None = None
    return_alt_m: float = math.nan
    return_climb_m: float = math.nan
    return_end_m: float = math.nan
    battery: float = math.nan
    fenced: bool = False
    failsafe: str = ""
    item_current: int = -1
    item_total: int = -1
    item_s: float = -math.inf
    item_reached: int = -1
    mission_over: bool = False
    target: tuple[float, float, float] | None = None
    target_s: float = -math.inf
    boot_s: float = math.nan
    heard_s: float = -math.inf
    position_s: float = -math.inf
    # Reports from which some of the above is derived.
    _position_good: bool = False
    _checks_passed: bool = False
    _landed_state: int = _LANDED_UNKNOWN
    _alarm: str = ""
    _alarm_s: float = -math.inf
    _battery_low: bool = False
    _unwell: str = ""
    _complaints: tuple[tuple[str, float], ...] = ()

    @property
    def unfit(self) -> str:
        """Why it must not be flown, by its kind or as it has a double; empty if it may be."""
        return self.problem or self.identity.twins

    @property
    def unready(self) -> str:
        """Its latest reports of why it is not ready; empty if it is, or has not reported why."""
        return "; ".join(text for text, _ in self._complaints)

    @property
    def has_position(self) -> bool:
        """Whether its position is known."""
        return math.isfinite(self.lat_deg) and math.isfinite(self.alt_m)


def observe(
    state: VehicleState, message: Incoming, now: float, autopilot: Autopilot
) -> VehicleState:
    """Return the state after a message of the vehicle.

    Args:
        state: What was known before.
        message: The message; one that is not about the state changes nothing.
        now: Our time in seconds.
        autopilot: Which autopilot it has.
    """
    match message:
        case Heartbeat():
            return _heartbeat(state, message, now, autopilot)
        case GlobalPosition():
            return _position(state, message, now)
        case Attitude(roll=roll, pitch=pitch):
            return replace(state, roll_rad=roll, pitch_rad=pitch)
        case GpsRaw(fix_type=fix, alt=alt_mm, alt_ellipsoid=alt_ellipsoid_mm):
            known = fix > _NO_FIX and alt_ellipsoid_mm != 0
            geoid_m = (alt_ellipsoid_mm - alt_mm) * 1e-3 if known else math.nan
            return _with(state, geoid_m=geoid_m)
        case SysStatus():
            return _sys_status(state, message, autopilot)
        case BatteryStatus(charge_state=charge):
            return _failsafe(_with(state, _battery_low=charge in autopilot.failsafe_charges))
        case EkfStatus(flags=flags):
            good = (
                bool(flags & mavlink.EKF_POS_HORIZ_ABS) and not flags & mavlink.EKF_CONST_POS_MODE
            )
            return _ready(_with(state, _position_good=good), good and state._checks_passed)
        case ExtendedSysState(landed_state=landed):
            return _flying(_with(state, _landed_state=landed))
        case HomePosition(latitude=lat, longitude=lon, altitude=alt):
            return _with(state, home=(lat * 1e-7, lon * 1e-7, alt * 1e-3))
        case ParamValue(param_id=name, param_value=value):
            return _parameter(state, name, value, autopilot)
        case PositionTarget():
            return replace(state, target=_target(state, message), target_s=now)
        case MissionCurrent(seq=seq, total=total, mission_state=mission_state):
            return replace(
                state,
                item_current=seq,
                item_total=total if total < _UNKNOWN_TOTAL else -1,
                item_s=now,
                mission_over=mission_state == mavlink.MISSION_STATE_COMPLETE,
            )
        case MissionItemReached(seq=seq):
            return replace(state, item_reached=seq)
        case AutopilotVersion():
            return replace(state, identity=with_version(state.identity, message, now))
        case StatusText(_, text):
            return _status_text(state, text, now, autopilot)
        case EventMessage():
            return _event(state, message, autopilot)
    return state


def _with(state: VehicleState, **reported: Any) -> VehicleState:
    """Return the state with what is reported; most reports are no news, and copies are slow."""
    before = vars(state)
    news = any(before[name] != value for name, value in reported.items())
    return replace(state, **reported) if news else state


def _parameter(state: VehicleState, name: str, value: float, autopilot: Autopilot) -> VehicleState:
    units = {
        "return_alt_m": autopilot.return_altitudes,
        "return_climb_m": autopilot.return_climbs,
        "return_end_m": autopilot.return_ends,
    }
    return _with(state, **{to: value * unit[name] for to, unit in units.items() if name in unit})


def without_link(state: VehicleState) -> VehicleState:
    """Return the state of a vehicle whose heartbeats have stopped: the last one that is known.

    When they come again, they may be another vehicle's.
    """
    return replace(state, connected=False, ready=False, identity=unidentified(state.identity))


def without_answer(state: VehicleState) -> VehicleState:
    """Return the state of a vehicle that does not report which one it is."""
    return replace(state, identity=without_uid(state.identity))


def _sys_status(state: VehicleState, message: SysStatus, autopilot: Autopilot) -> VehicleState:
    health, remaining = message.onboard_control_sensors_health, message.battery_remaining
    passed = bool(health & mavlink.MAV_SYS_STATUS_PREARM_CHECK)
    placed = state.has_position if autopilot.position_is_checked else state._position_good
    missing = message.onboard_control_sensors_enabled & ~health
    state = _failsafe(
        _with(
            state,
            battery=remaining / 100 if 0 <= remaining <= 100 else math.nan,
            fenced=bool(message.onboard_control_sensors_enabled & mavlink.MAV_SYS_STATUS_GEOFENCE),
            _checks_passed=passed,
            _unwell=next((name for bit, name in _SENSORS.items() if missing & bit), ""),
        )
    )
    return _ready(state, passed and placed)


def _ready(state: VehicleState, ready: bool) -> VehicleState:
    return _with(state, ready=ready, _complaints=() if ready else state._complaints)


def _failsafe(state: VehicleState) -> VehicleState:
    """Name the failsafe that is active, if one is, by what else is known."""
    if not state.failsafe:
        return state
    battery = "battery" if state._battery_low else ""
    return replace(state, failsafe=state._alarm or battery or state._unwell or "critical")


def _heartbeat(
    state: VehicleState, message: Heartbeat, now: float, autopilot: Autopilot
) -> VehicleState:
    critical = message.system_status in _CRITICAL
    alarm = state._alarm if critical or now - state._alarm_s < _ALARM_S else ""
    proven = alarm if autopilot.texts_prove_failsafe else ""
    armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
    known = replace(
        state,
        identity=with_heartbeat(state.identity, armed=armed, now=now),
        connected=True,
        heard_s=now,
        armed=armed,
        disarmed_beats=0 if armed else state.disarmed_beats + 1,
        problem=autopilot.problem(message.type, message.autopilot),
        mode=autopilot.mode_name(message.custom_mode),
        failsafe="critical" if critical else proven,
        _alarm=alarm,
        # From now on the heartbeats report when it is over.
        _alarm_s=-math.inf if critical else state._alarm_s,
    )
    known = _failsafe(known)
    if state._landed_state == _LANDED_UNKNOWN:
        # It has not reported its landed state yet.
        return _with(known, flying=armed and message.system_status >= mavlink.MAV_STATE_ACTIVE)
    return _flying(known)


def _flying(state: VehicleState) -> VehicleState:
    if state._landed_state == _LANDED_UNKNOWN:
        return state
    return _with(state, flying=state.armed and state._landed_state in _AIRBORNE)


def _position(state: VehicleState, message: GlobalPosition, now: float) -> VehicleState:
    identity = with_position(state.identity, message, now)
    if max(abs(message.lat), abs(message.lon)) < _NOWHERE:
        # Autopilots send this while the position is unknown: ArduPlane, what its gyros make of it.
        return replace(state, identity=identity)
    heading_deg = message.hdg / 100 if message.hdg <= _MAX_HEADING else math.nan
    return replace(
        state,
        identity=identity,
        lat_deg=message.lat * 1e-7,
        lon_deg=message.lon * 1e-7,
        alt_amsl_m=message.alt * 1e-3,
        alt_m=message.relative_alt * 1e-3,
        heading_deg=heading_deg,
        speed_mps=math.hypot(message.vx, message.vy) / 100,
        climb_mps=-message.vz / 100,
        boot_s=message.time_boot_ms * 1e-3,
        position_s=now,
    )


def _target(state: VehicleState, message: PositionTarget) -> tuple[float, float, float] | None:
    if message.type_mask & NO_POSITION:
        return None
    alt_amsl_m = message.alt
    if message.coordinate_frame in _RELATIVE_FRAMES:
        alt_amsl_m += state.alt_amsl_m - state.alt_m
    elif message.coordinate_frame not in _GLOBAL_FRAMES:
        return None
    return message.lat_int * 1e-7, message.lon_int * 1e-7, alt_amsl_m


def _status_text(state: VehicleState, text: str, now: float, autopilot: Autopilot) -> VehicleState:
    lower = text.lower()
    if lower.startswith(autopilot.check_texts):
        complaints = dict(state._complaints) | {text: now}
        since_s = now - autopilot.checks_s
        latest = tuple((about, time_s) for about, time_s in complaints.items() if time_s > since_s)
        return replace(state, _complaints=latest)
    for name, signs in autopilot.failsafe_texts:
        if name in lower and any(sign in lower for sign in signs):
            alarm = "" if _CLEARED in lower else name
            if autopilot.texts_prove_failsafe:
                return replace(state, failsafe=alarm, _alarm=alarm, _alarm_s=now)
            return _failsafe(replace(state, _alarm=alarm, _alarm_s=now))
    return state


def _event(state: VehicleState, event: EventMessage, autopilot: Autopilot) -> VehicleState:
    complaints = dict(state._complaints)
    if event.id == autopilot.check_report:
        complaints = {
            text: time_s for text, time_s in complaints.items() if time_s != _UNTIL_THE_NEXT_REPORT
        }
    elif text := autopilot.failed_check(event):
        complaints[text] = _UNTIL_THE_NEXT_REPORT
    return replace(state, _complaints=tuple(complaints.items()))


class MessageRequests:
    """Requests for the messages that are needed, repeated until they come, and when they stop.

    The altitudes and the climb of its return are requested too, as parameters. Its id is requested
    again and again, because it may be exchanged, or have a double.

    An autopilot may acknowledge a request and forget it, and loses all of them when it restarts.

    Args:
        target: The vehicle's autopilot.
        autopilot: Which autopilot it is.
        position_hz: How often to ask for positions, attitudes and the target.
    """

    def __init__(self, target: Address, autopilot: Autopilot, position_hz: float) -> None:
        self._target = target
        self._kinds = autopilot.messages
        # It has one parameter of each.
        kinds = (autopilot.return_altitudes, autopilot.return_climbs, autopilot.return_ends)
        self._parameters = [names for names in kinds if names]
        self._rates_hz = dict.fromkeys(self._kinds, _RATE_HZ)
        for kind in (GlobalPosition, Attitude, PositionTarget):
            if kind in self._rates_hz:
                self._rates_hz[kind] = position_hz
        self._received_s = dict.fromkeys(self._kinds, -math.inf)
        requested = [*self._kinds, HomePosition, AutopilotVersion]
        self._requested_s = dict.fromkeys(requested, -math.inf)
        self.forget()
        self._parameter_s = -math.inf
        self._asked_s = math.inf

    def forget(self) -> None:
        """Request again what does not change while the same vehicle is connected."""
        self._has_home = self._has_version = False
        self._version_asks = 0

    @property
    def has_no_version(self) -> bool:
        """Whether it does not answer the requests for its id."""
        return self._version_asks > _VERSION_ASKS and not self._has_version

    def receive(self, message: Incoming, now: float) -> None:
        """Take note of a message."""
        kind = type(message)
        if kind in self._received_s:
            self._received_s[kind] = now
        elif kind is HomePosition:
            self._has_home = True
        elif kind is AutopilotVersion:
            self._has_version = True
        elif isinstance(message, ParamValue):
            name = message.param_id
            self._parameters = [names for names in self._parameters if name not in names]

    def due(self, now: float, *, has_setpoint: bool, unexplained: bool = False) -> list[Outgoing]:
        """Return the requests to send now.

        Args:
            now: Our time in seconds.
            has_setpoint: Whether it flies to a setpoint, and should report it.
            unexplained: Whether it cannot be armed and has not reported why. PX4 reports its checks
                when they change, and when it is asked.
        """
        requests: list[Outgoing] = []
        if not (unexplained and math.isfinite(self._asked_s)):
            self._asked_s = now
        elif now - self._asked_s > _ASK_AGAIN_S:
            self._asked_s = now
            requests.append(command_long(self._target, mavlink.MAV_CMD_RUN_PREARM_CHECKS))
        for kind in self._kinds:
            rate_hz = self._rates_hz[kind]
            late = now - self._received_s[kind] > _MISSED / rate_hz + _GRACE_S
            # It reports its target only while it has one.
            requested = self._requested_s[kind] > -math.inf
            wanted = has_setpoint or kind is not PositionTarget or not requested
            if late and wanted and now - self._requested_s[kind] > _REQUEST_AGAIN_S:
                self._requested_s[kind] = now
                parameters = (float(kind.id), round(1e6 / rate_hz))
                requests.append(
                    command_long(self._target, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, *parameters)
                )
        again_s = _ASK_AGAIN_S if self._has_version else _REQUEST_AGAIN_S
        for message, wanted, period_s in (
            (HomePosition, not self._has_home, _REQUEST_AGAIN_S),
            (AutopilotVersion, True, again_s),
        ):
            if wanted and now - self._requested_s[message] > period_s:
                self._requested_s[message] = now
                self._version_asks += message is AutopilotVersion
                requests.append(
                    command_long(self._target, mavlink.MAV_CMD_REQUEST_MESSAGE, float(message.id))
                )
        if self._parameters and now - self._parameter_s > _ASK_AGAIN_S:
            self._parameter_s = now
            requests += [
                ParamRequestRead(*self._target, name.encode(), _BY_NAME)
                for name in sorted({name for names in self._parameters for name in names})
            ]
        return requests

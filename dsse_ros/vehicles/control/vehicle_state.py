# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state that a vehicle reports in its messages."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.autopilots import Autopilot, Failsafe
from dsse_ros.vehicles.control.identity import (
    DOUBLE,
    Identity,
    unidentified,
    with_heartbeat,
    with_position,
    with_version,
    without_uid,
)
from dsse_ros.vehicles.control.motor_stop import MotorStop, with_altitude, with_motors
from dsse_ros.vehicles.mavlink.events import EventMessage
from dsse_ros.vehicles.mavlink.messages import (
    NO_POSITION,
    Attitude,
    AutopilotVersion,
    BatteryStatus,
    EkfStatus,
    EstimatorStatus,
    ExtendedSysState,
    GlobalPosition,
    GpsRaw,
    Heartbeat,
    HomePosition,
    Incoming,
    MissionCurrent,
    MissionItemReached,
    ParamValue,
    PositionTarget,
    StatusText,
    SysStatus,
    Wind,
    WindCov,
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
    mavlink.MAV_SYS_STATUS_AHRS: Failsafe.EKF,
    mavlink.MAV_SYS_STATUS_SENSOR_GPS: Failsafe.GPS,
    mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS: Failsafe.MOTORS,
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
_ERROR = mavlink.MAV_SEVERITY_ERROR
_SETTLED_BEATS = 3
"""Disarmed heartbeats after which a vehicle without positions counts as on the ground."""
_DOUBLES_S = 3.0
"""Time without a heartbeat of an armed vehicle after which those of its double count."""
_CLOCK_RATE, _CLOCK_SLACK_S = 20.0, 2.0
"""How much faster than ours a vehicle's clock may go, and how late a position may be."""
_MAX_WIND_MPS = 100.0


@dataclass(frozen=True)
class VehicleState:
    """What a vehicle reports; numbers that are not known are NaN.

    Attributes:
        identity: Which vehicle it is.
        connected: Whether heartbeats come.
        ready: Whether its position is good and its pre-arm checks are passed.
        armed: Whether its motors turn, or may.
        disarmed_beats: Number of the last heartbeats that were not armed.
        motor_stop: Whether its motors have stopped in the air.
        problem: Why it must not be flown, as it is another kind of vehicle; None if it may be.
        mode: Name of its flight mode: see `Autopilot`; empty before its first heartbeat.
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
        velocity_mps: Over ground, north and east.
        climb_mps: Upwards.
        home: Latitude, longitude in degrees and altitude above mean sea level.
        return_alt_m: Altitude above home to which it climbs before it returns.
        return_climb_m: Height that it climbs at least before it returns.
        return_end_m: Altitude above home at which it circles over home; negative for any.
        speed_limit_mps: Greatest speed of tracks: see `Autopilot.speed_limits`.
        own_speed_mps: Airspeed of a fixed wing if no other one is requested.
        least_speed_mps: Least airspeed of a fixed wing.
        disarm_delay_s: Time after which it disarms itself if it does not take off; 0 or less for
            never.
        dead_reckons: Whether it estimates its position without a GPS or the like.
        wind: Velocity of the wind to the east and to the north, m/s, by its own estimate.
        battery: 0 (empty) to 1.
        fenced: Whether a geofence of its own is enabled.
        failsafe: The failsafe that is active; None if none is.
        item_current: Number of the mission item that is flown, or would be; -1 if none.
        item_total: Number of the items of its mission, without home; -1 if not known.
        item_s: Our time of the last report of these items.
        mission_id: Number that it makes of the content of its mission; 0 if it makes none.
        mission: Digest of its mission as it was read back last: see `mission_digest`; None if it
            was not, or may have changed since.
        mission_changes: How often its mission may have changed.
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
    motor_stop: MotorStop = MotorStop()
    problem: str | None = None
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
    velocity_mps: tuple[float, float] = (math.nan, math.nan)
    climb_mps: float = math.nan
    home: tuple[float, float, float] | None = None
    return_alt_m: float = math.nan
    return_climb_m: float = math.nan
    return_end_m: float = math.nan
    speed_limit_mps: float = math.nan
    own_speed_mps: float = math.nan
    least_speed_mps: float = math.nan
    disarm_delay_s: float = math.nan
    dead_reckons: bool = False
    wind: tuple[float, float] | None = None
    battery: float = math.nan
    fenced: bool = False
    failsafe: Failsafe | None = None
    item_current: int = -1
    item_total: int = -1
    item_s: float = -math.inf
    mission_id: int = 0
    mission: str | None = None
    mission_changes: int = 0
    item_reached: int = -1
    mission_over: bool = False
    target: tuple[float, float, float] | None = None
    target_s: float = -math.inf
    boot_s: float = math.nan
    heard_s: float = -math.inf
    position_s: float = -math.inf
    # Reports from which some of the above is derived.
    _armed_s: float = -math.inf
    _position_good: bool = False
    _checks_passed: bool = False
    _landed_state: int = _LANDED_UNKNOWN
    _alarm: Failsafe | None = None
    _alarm_s: float = -math.inf
    _battery_low: bool = False
    _unwell: Failsafe | None = None
    _complaints: tuple[tuple[str, float], ...] = ()
    _failing: frozenset[str] = frozenset()

    @property
    def unfit(self) -> str | None:
        """Why it must not be flown, by its kind or as it has a double; None if it may be."""
        return self.problem or (DOUBLE if self.identity.has_double else None)

    @property
    def crashed(self) -> str | None:
        """How it has crashed; None if it has not, or has been armed since."""
        return self.motor_stop.crashed

    @property
    def settled(self) -> bool:
        """Whether it is known if its motors, once they do not turn, have stopped in the air."""
        return self.motor_stop.settled or self.disarmed_beats > _SETTLED_BEATS

    @property
    def unready(self) -> str | None:
        """Its latest reports of why it is not ready; None if it is, or has not reported why."""
        return None if self.ready else "; ".join(text for text, _ in self._complaints) or None

    @property
    def failed_checks(self) -> frozenset[str]:
        """The checks of any mode that fail by its latest report, ready or not."""
        return self._failing

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
            known = math.isfinite(roll) and math.isfinite(pitch)
            return replace(state, roll_rad=roll, pitch_rad=pitch) if known else state
        case GpsRaw(fix_type=fix, alt=alt_mm, alt_ellipsoid=alt_ellipsoid_mm):
            known = fix > _NO_FIX and alt_ellipsoid_mm != 0
            geoid_m = (alt_ellipsoid_mm - alt_mm) * 1e-3 if known else math.nan
            return _with(state, geoid_m=geoid_m)
        case Wind(direction=from_deg, speed=speed):
            return _wind(state, *_toward(from_deg, speed))
        case WindCov(wind_x=north, wind_y=east):
            return _wind(state, east, north)
        case SysStatus():
            return _sys_status(state, message, autopilot)
        case BatteryStatus(charge_state=charge):
            return _failsafe(_with(state, _battery_low=charge in autopilot.failsafe_charges))
        case EkfStatus(flags=flags):
            good = (
                bool(flags & mavlink.EKF_POS_HORIZ_ABS) and not flags & mavlink.EKF_CONST_POS_MODE
            )
            state = _with(state, _position_good=good, dead_reckons=_dead_reckons(flags))
            return _ready(state, good and state._checks_passed)
        case EstimatorStatus(flags=flags):
            return _with(state, dead_reckons=_dead_reckons(flags))
        case ExtendedSysState(landed_state=landed):
            grounded = landed not in _AIRBORNE and state.identity.has_double
            if grounded and _may_be_doubles(state, now):
                return state
            return _flying(_with(state, _landed_state=landed))
        case HomePosition() if _may_be_doubles(state, now):
            return state
        case HomePosition(latitude=lat, longitude=lon, altitude=alt):
            return _with(state, home=(lat * 1e-7, lon * 1e-7, alt * 1e-3))
        case ParamValue(param_id=name, param_value=value):
            return _parameter(state, name, value, autopilot)
        case PositionTarget():
            return replace(state, target=_target(state, message), target_s=now)
        case MissionCurrent():
            return _mission_current(state, message, now)
        case MissionItemReached(seq=seq):
            return replace(state, item_reached=seq)
        case AutopilotVersion():
            return replace(state, identity=with_version(state.identity, message, now))
        case StatusText(_, text):
            return _status_text(state, text, now, autopilot)
        case EventMessage():
            return _event(state, message, autopilot)
    return state


def _dead_reckons(flags: int) -> bool:
    """Return whether an estimator goes on without what measures where the vehicle is.

    ArduPilot then clears ESTIMATOR_PRED_POS_HORIZ_ABS together with the position itself, PX4 alone:
    a fixed wing of PX4 has a position for 25 s more.

    Args:
        flags: ESTIMATOR_STATUS_FLAGS; EKF_STATUS_FLAGS has the same bit.
    """
    return not flags & mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS


def _with(state: VehicleState, **reported: Any) -> VehicleState:
    """Return the state with what is reported; most reports are no news, and copies are slow."""
    before = vars(state)
    news = any(before[name] != value for name, value in reported.items())
    return replace(state, **reported) if news else state


def with_changed_mission(state: VehicleState) -> VehicleState:
    """Return the state of a vehicle whose mission may have changed."""
    return replace(state, mission=None, mission_changes=state.mission_changes + 1)


def _mission_current(state: VehicleState, message: MissionCurrent, now: float) -> VehicleState:
    total = message.total if message.total < _UNKNOWN_TOTAL else -1
    other = (total, message.mission_id) != (state.item_total, state.mission_id)
    if other and math.isfinite(state.item_s):
        state = with_changed_mission(state)
    return replace(
        state,
        item_current=message.seq,
        item_total=total,
        item_s=now,
        mission_id=message.mission_id,
        mission_over=message.mission_state == mavlink.MISSION_STATE_COMPLETE,
    )


def _toward(from_deg: float, speed: float) -> tuple[float, float]:
    """Return the velocity to the east and to the north of a wind by where it comes from."""
    if not math.isfinite(from_deg):
        return math.nan, math.nan
    toward = math.radians(from_deg + 180.0)
    return speed * math.sin(toward), speed * math.cos(toward)


def _wind(state: VehicleState, east: float, north: float) -> VehicleState:
    # ArduPilot reports 0, exactly, while it does not estimate the wind.
    known = 0.0 < math.hypot(east, north) <= _MAX_WIND_MPS
    return _with(state, wind=(east, north)) if known else state


def _parameter(state: VehicleState, name: str, value: float, autopilot: Autopilot) -> VehicleState:
    if not math.isfinite(value):
        return state
    units = {
        "return_alt_m": autopilot.return_altitudes,
        "return_climb_m": autopilot.return_climbs,
        "return_end_m": autopilot.return_ends,
        "speed_limit_mps": autopilot.speed_limits,
        "own_speed_mps": autopilot.own_speeds,
        "least_speed_mps": autopilot.least_speeds,
        "disarm_delay_s": autopilot.disarm_delays,
    }
    return _with(state, **{to: value * unit[name] for to, unit in units.items() if name in unit})


def without_link(state: VehicleState) -> VehicleState:
    """Return the state of a vehicle whose heartbeats have stopped: the last one that is known.

    When they come again, they may be another vehicle's, and its mission another one.
    """
    return replace(
        with_changed_mission(state),
        connected=False,
        ready=False,
        identity=unidentified(state.identity),
    )


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
            _unwell=next((cause for bit, cause in _SENSORS.items() if missing & bit), None),
        )
    )
    return _ready(state, passed and placed)


def _ready(state: VehicleState, ready: bool) -> VehicleState:
    if not ready:
        return _with(state, ready=False)
    # It may have been ready when it reported that last; only its next report ends these.
    reported = tuple(
        complaint for complaint in state._complaints if complaint[1] == _UNTIL_THE_NEXT_REPORT
    )
    return _with(state, ready=True, _complaints=reported)


def _failsafe(state: VehicleState) -> VehicleState:
    """Name the failsafe that is active, if one is, by what else is known."""
    if not state.failsafe:
        return state
    battery = Failsafe.BATTERY if state._battery_low else None
    named = state._alarm or battery or state._unwell
    return replace(state, failsafe=named or Failsafe.CRITICAL)


def _heartbeat(
    state: VehicleState, message: Heartbeat, now: float, autopilot: Autopilot
) -> VehicleState:
    critical = message.system_status in _CRITICAL
    alarm = state._alarm if critical or now - state._alarm_s < _ALARM_S else None
    proven = alarm if autopilot.texts_prove_failsafe else None
    armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
    heard = replace(
        state,
        identity=with_heartbeat(state.identity, armed=armed, now=now),
        connected=True,
        heard_s=now,
        disarmed_beats=0 if armed else state.disarmed_beats + 1,
    )
    if not armed and heard.identity.has_double and _may_be_doubles(heard, now):
        return heard
    heard = replace(
        heard,
        motor_stop=with_motors(
            state.motor_stop,
            before=state.armed and not state.disarmed_beats,
            armed=armed,
            boot_s=state.boot_s,
            alt_amsl_m=state.alt_amsl_m,
            climb_mps=state.climb_mps,
        ),
    )
    if not armed and _may_be_doubles(heard, now):
        return heard
    known = replace(
        heard,
        armed=armed,
        _armed_s=now if armed else state._armed_s,
        problem=autopilot.problem(message.type, message.autopilot),
        mode=autopilot.mode_name(message.custom_mode),
        failsafe=Failsafe.CRITICAL if critical else proven,
        _alarm=alarm,
        # From now on the heartbeats report when it is over.
        _alarm_s=-math.inf if critical else state._alarm_s,
    )
    known = _failsafe(known)
    if state._landed_state == _LANDED_UNKNOWN:
        # It has not reported its landed state yet.
        return _with(known, flying=armed and message.system_status >= mavlink.MAV_STATE_ACTIVE)
    return _flying(known)


def _may_be_doubles(state: VehicleState, now: float) -> bool:
    """Return whether a report from the ground may be that of another vehicle with the same id.

    For one in the air the first heartbeat without the armed flag may be, and while it is known that
    there are two, whatever the one on the ground reports, as long as the armed one is heard.

    Args:
        state: What was known before, with the heartbeats counted.
        now: Our time in seconds.
    """
    if not (state.armed and state.flying) or state.crashed:
        return False
    if state.identity.has_double:
        return now - state._armed_s < _DOUBLES_S
    return state.disarmed_beats == 1


def _flying(state: VehicleState) -> VehicleState:
    if state._landed_state == _LANDED_UNKNOWN:
        return state
    return _with(state, flying=state.armed and state._landed_state in _AIRBORNE)


def _position(state: VehicleState, message: GlobalPosition, now: float) -> VehicleState:
    identity = with_position(state.identity, message, now)
    if max(abs(message.lat), abs(message.lon)) < _NOWHERE:
        # Autopilots send this while the position is unknown: ArduPlane, what its gyros make of it.
        return replace(state, identity=identity)
    boot_s = message.time_boot_ms * 1e-3
    passed_s = boot_s - state.boot_s
    latest_s = _CLOCK_RATE * (now - state.position_s) + _CLOCK_SLACK_S
    if identity.has_double and _may_be_doubles(state, now) and not 0.0 <= passed_s <= latest_s:
        # Its clock shows that it is the position of the double.
        return replace(state, identity=identity)
    heading_deg = message.hdg / 100 if message.hdg <= _MAX_HEADING else math.nan
    motor_stop = with_altitude(
        state.motor_stop,
        armed=state.armed and (not state.disarmed_beats or identity.has_double),
        flying=state.flying or state._landed_state in _AIRBORNE,
        boot_s=boot_s,
        alt_amsl_m=message.alt * 1e-3,
        alt_m=message.relative_alt * 1e-3,
        climb_mps=-message.vz / 100,
        speed_mps=math.hypot(message.vx, message.vy) / 100,
    )
    return replace(
        state,
        identity=identity,
        armed=state.armed and not motor_stop.crashed,
        flying=state.flying and not motor_stop.crashed,
        lat_deg=message.lat * 1e-7,
        lon_deg=message.lon * 1e-7,
        alt_amsl_m=message.alt * 1e-3,
        alt_m=message.relative_alt * 1e-3,
        heading_deg=heading_deg,
        speed_mps=math.hypot(message.vx, message.vy) / 100,
        velocity_mps=(message.vx / 100, message.vy / 100),
        climb_mps=-message.vz / 100,
        motor_stop=motor_stop,
        boot_s=boot_s,
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
    if lower.startswith(autopilot.mission_texts):
        return with_changed_mission(state)
    if lower.startswith(autopilot.check_texts):
        complaints = dict(state._complaints) | {text: now}
        since_s = now - autopilot.checks_s
        latest = tuple((about, time_s) for about, time_s in complaints.items() if time_s > since_s)
        return replace(state, _complaints=latest)
    for failsafe, signs in autopilot.failsafe_texts:
        if failsafe.value in lower and any(sign in lower for sign in signs):
            alarm = None if _CLEARED in lower else failsafe
            if autopilot.texts_prove_failsafe:
                return replace(state, failsafe=alarm, _alarm=alarm, _alarm_s=now)
            return _failsafe(replace(state, _alarm=alarm, _alarm_s=now))
    return state


def _event(state: VehicleState, event: EventMessage, autopilot: Autopilot) -> VehicleState:
    complaints, failing = dict(state._complaints), state._failing
    text, is_error = autopilot.failed_check(event), event.log_levels & 0xF <= _ERROR
    if event.id in autopilot.checks and (text or is_error):
        failing |= {autopilot.checks[event.id]}
    if event.id == autopilot.check_report:
        failing = frozenset()
        complaints = {
            text: time_s for text, time_s in complaints.items() if time_s != _UNTIL_THE_NEXT_REPORT
        }
    elif text:
        complaints[text] = _UNTIL_THE_NEXT_REPORT
    return replace(state, _complaints=tuple(complaints.items()), _failing=failing)

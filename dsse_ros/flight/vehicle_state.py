# SPDX-License-Identifier: Apache-2.0
"""What a vehicle says of itself, put together from its messages."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from dsse_ros.flight.modes import mode_name
from dsse_ros.flight.readback import Dialect
from dsse_ros.flight.telegrams import (
    EkfStatus,
    ExtendedSysState,
    GlobalPosition,
    Heard,
    Heartbeat,
    HomePosition,
    MissionCurrent,
    MissionItemReached,
    PositionTarget,
    StatusText,
    SysStatus,
)

_ARMED = 128
_STATE_ACTIVE, _STATE_CRITICAL, _STATE_EMERGENCY = 4, 5, 6
_POSITION_GOOD, _POSITION_CONSTANT = 16, 128
_PREARM_CHECK = 1 << 28
_LANDED_ON_GROUND = 1
_AIRBORNE = frozenset({2, 3, 4})
_UNKNOWN_HEADING = 65535
_GLOBAL_FRAMES = frozenset({0, 5})
_RELATIVE_FRAMES = frozenset({3, 6})
_FAILSAFE_TEXTS = (
    ("battery", ("is low", "failsafe", "low battery", "is critical")),
    ("gcs", ("failsafe",)),
    ("radio", ("failsafe",)),
    ("ekf", ("failsafe",)),
    ("offboard", ("signal lost",)),
)
_CLEARED = "cleared"


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
        failsafe: Empty, or which one has struck: `battery`, `gcs`, `radio`, `ekf`, `offboard`, or
            `critical` if it does not say which.
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
    _landed_state: int = 0
    _alarm: str = ""

    @property
    def has_position(self) -> bool:
        """Whether its place is known."""
        return math.isfinite(self.lat_deg) and math.isfinite(self.alt_m)


def observe(state: VehicleState, heard: Heard, now: float, dialect: Dialect) -> VehicleState:
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
        case SysStatus(health, remaining):
            passed = bool(health & _PREARM_CHECK)
            battery = remaining / 100 if 0 <= remaining <= 100 else math.nan
            ready = passed and state._position_good
            return replace(state, battery=battery, _checks_passed=passed, ready=ready)
        case EkfStatus(flags):
            good = bool(flags & _POSITION_GOOD) and not flags & _POSITION_CONSTANT
            return replace(state, _position_good=good, ready=good and state._checks_passed)
        case ExtendedSysState(landed):
            return _flying(replace(state, _landed_state=landed))
        case HomePosition(lat, lon, alt):
            return replace(state, home=(lat * 1e-7, lon * 1e-7, alt * 1e-3))
        case PositionTarget():
            return replace(state, target=_target(state, heard), target_s=now)
        case MissionCurrent(seq, mission_state):
            return replace(state, item_current=seq, mission_over=mission_state == 5)
        case MissionItemReached(seq):
            return replace(state, item_reached=seq)
        case StatusText(_, text):
            return _status_text(state, text)
    return state


def without_link(state: VehicleState) -> VehicleState:
    """Return the state of a vehicle that is not heard any more: the last one that is known."""
    return replace(state, connected=False, ready=False)


def _heartbeat(state: VehicleState, heard: Heartbeat, now: float, dialect: Dialect) -> VehicleState:
    critical = heard.system_status in (_STATE_CRITICAL, _STATE_EMERGENCY)
    armed = bool(heard.base_mode & _ARMED)
    known = replace(
        state,
        connected=True,
        heard_s=now,
        armed=armed,
        mode=mode_name(heard.custom_mode, dialect),
        failsafe=(state._alarm or "critical") if critical else "",
        _alarm=state._alarm if critical else "",
    )
    if state._landed_state == 0:
        # It has not said more exactly yet.
        return replace(known, flying=armed and heard.system_status >= _STATE_ACTIVE)
    return _flying(known)


def _flying(state: VehicleState) -> VehicleState:
    if state._landed_state == 0:
        return state
    return replace(state, flying=state.armed and state._landed_state in _AIRBORNE)


def _position(state: VehicleState, heard: GlobalPosition, now: float) -> VehicleState:
    if heard.lat == 0 and heard.lon == 0:
        # So it says when it does not know.
        return state
    heading_deg = math.nan if heard.hdg == _UNKNOWN_HEADING else heard.hdg / 100
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
    if heard.type_mask & 0b111:
        return None
    alt_amsl_m = heard.alt
    if heard.coordinate_frame in _RELATIVE_FRAMES:
        alt_amsl_m += state.alt_amsl_m - state.alt_m
    elif heard.coordinate_frame not in _GLOBAL_FRAMES:
        return None
    return heard.lat_int * 1e-7, heard.lon_int * 1e-7, alt_amsl_m


def _status_text(state: VehicleState, text: str) -> VehicleState:
    lower = text.lower()
    if lower.startswith(("prearm:", "arm:")):
        return state
    for name, signs in _FAILSAFE_TEXTS:
        if name in lower and any(sign in lower for sign in signs):
            alarm = "" if _CLEARED in lower else name
            return replace(state, failsafe=alarm, _alarm=alarm)
    return state

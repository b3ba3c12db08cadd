# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What differs between autopilots, as fields of `Autopilot`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.autopilots.failsafe import Failsafe
from dsse_ros.vehicles.mavlink.events import EventMessage
from dsse_ros.vehicles.mavlink.messages import (
    Attitude,
    ExtendedSysState,
    GlobalPosition,
    GpsRaw,
    MissionCurrent,
    SysStatus,
    enum_name,
)

MESSAGES = (GlobalPosition, Attitude, GpsRaw, SysStatus, ExtendedSysState, MissionCurrent)
"""Types of the messages that every autopilot sends."""
_NO_MODES: frozenset[str] = frozenset()
_FAILSAFE_TEXTS = (
    (Failsafe.BATTERY, ("is low", "failsafe", "low battery", "is critical")),
    (Failsafe.GCS, ("failsafe",)),
    (Failsafe.RADIO, ("failsafe",)),
    (Failsafe.EKF, ("failsafe",)),
    (Failsafe.FENCE, ("breach",)),
)
_FAILSAFE_CHARGES = frozenset(
    {
        mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL,
        mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY,
        mavlink.MAV_BATTERY_CHARGE_STATE_FAILED,
    }
)
MULTICOPTERS = (
    mavlink.MAV_TYPE_QUADROTOR,
    mavlink.MAV_TYPE_COAXIAL,
    mavlink.MAV_TYPE_HELICOPTER,
    mavlink.MAV_TYPE_HEXAROTOR,
    mavlink.MAV_TYPE_OCTOROTOR,
    mavlink.MAV_TYPE_TRICOPTER,
    mavlink.MAV_TYPE_DODECAROTOR,
    mavlink.MAV_TYPE_DECAROTOR,
)
"""HEARTBEAT.type of the vehicles that take off and land upright."""
FIXED_WINGS = (mavlink.MAV_TYPE_FIXED_WING,)


def _no_check(event: EventMessage) -> str | None:
    return None


@dataclass(frozen=True, kw_only=True)
class Autopilot:
    """How an autopilot is flown, and what its messages mean.

    Attributes:
        name: Its name in parameters.
        number: HEARTBEAT.autopilot.
        kinds: HEARTBEAT.type of the vehicles whose modes are known here; plan files have the first.
        kind: What they are called.
        circle_m: Distance within which a vehicle that cannot hover circles over a place; 0 for one
            that can.
        alt_error_m: How far from its altitude it may stay.
        repositions: Whether it flies to places by MAV_CMD_DO_REPOSITION, not to position targets.
        modes: Names of the flight modes by the fields of HEARTBEAT.custom_mode.
        mode_shifts: Bit positions of these fields.
        mode_mask: Bits of each of them.
        guided_mode: Mode in which it flies to setpoints.
        resting_mode: Mode in which it waits for orders, and from which it takes off.
        mission_mode: Mode in which it flies a mission.
        return_mode: Mode in which it flies home and lands.
        land_mode: Mode in which it lands on the spot.
        take_off_mode: Mode of a commanded take-off; None if that does not change the mode. It
            ends in `resting_mode`.
        takes_off_by_mode: Whether it takes off as that mode is set, without MAV_CMD_NAV_TAKEOFF.
        boot_modes: Modes in which it may start without a person having chosen them.
        landed_modes: Modes in which it may be on the ground after a flight for us.
        item_modes: Modes that mission items bring about, by their MAV_CMD.
        return_altitudes: Parameters with the altitude above home to which it climbs before it
            returns, and their units in metres; it has one of them.
        return_climbs: Parameters with the height that it climbs at least before it returns, near
            home too, in the same way.
        return_ends: Parameters with the altitude above home at which a fixed wing circles in the
            end, in the same way; negative for the one at which it comes.
        speed_limits: Parameters with the greatest speed at which it flies along tracks, over ground
            or of a fixed wing through the air, and their units in m/s; it has one of them.
        own_speeds: Parameters with the airspeed at which a fixed wing flies if no other one is
            requested, in the same way.
        least_speeds: Parameters with the least airspeed of a fixed wing, in the same way.
        disarm_delays: Parameters with the time after which it disarms itself if it does not take
            off, and their units in seconds; 0 or less for never.
        disarmed_modes: Modes that it enters by itself while it is disarmed.
        disarming_s: Time after disarming in which it may fall back into any mode.
        messages: Types of the messages that we need from it.
        position_is_checked: Whether its pre-arm check covers its position estimate. If not,
            EKF_STATUS_REPORT has to report a good estimate.
        texts_prove_failsafe: Whether a STATUSTEXT about a failsafe is sent only if one is active.
        failsafe_texts: Failsafes that a STATUSTEXT names, with words one of which it has too.
        failsafe_charges: MAV_BATTERY_CHARGE_STATE at which it acts.
        mission_texts: How a STATUSTEXT begins that says that its mission was changed.
        check_texts: How a STATUSTEXT begins that says why it cannot be armed.
        checks_s: Time after which such a text, if it is not repeated, is not true any more.
        check_report: Number of the event that begins a report of its arming checks; 0 for none.
        checks: Its arming checks by the numbers of their events.
        failed_check: Returns which arming check has failed according to an event of such a report;
            None for none.
        acts_when_critical: Whether it reports a critical state only while a failsafe flies it, in
            whatever mode.
        mode_is_checked: Whether the pre-arm check depends on the mode, and passes in
            `resting_mode` alone.
        streams_setpoints: Whether it needs setpoints all the time in `guided_mode`. If not, each is
            sent until POSITION_TARGET_GLOBAL_INT confirms it.
        setpoint_loss_modes: Modes to which it may change for lack of setpoints.
        setpoint_loss_event: Number of the event that reports that setpoints are missing; 0 for
            none.
        paced_setpoints: Whether it ignores MAV_CMD_DO_CHANGE_SPEED in `guided_mode`, so that a
            speed is flown by setpoints that move.
        take_off_amsl: Whether MAV_CMD_NAV_TAKEOFF has an altitude above mean sea level; if not,
            above home.
        unchanged: Parameter of MAV_CMD_NAV_TAKEOFF that keeps position and yaw.
        missions_by_command: Whether MAV_CMD_MISSION_START starts a mission on the ground. If not,
            `mission_mode` does.
        home_first: Whether item 0 of its missions is home; else it is the first to fly.
        keeps_item_radius: Whether it stores the acceptance radius of each waypoint.
        parameter_tolerance: Greatest difference of an item's parameter that is read back.
        upload_can_be_cancelled: Whether MISSION_ACK with CANCELLED ends an upload.
        first_port: UDP port to which the first simulated vehicle sends.
        port_step: Difference to the port of the next one.
    """

    name: str
    number: int
    kinds: tuple[int, ...] = MULTICOPTERS
    kind: str = "a multicopter"
    circle_m: float = 0.0
    alt_error_m: float = 0.0
    repositions: bool = False
    modes: Mapping[tuple[int, ...], str]
    mode_shifts: tuple[int, ...]
    mode_mask: int
    guided_mode: str
    resting_mode: str
    mission_mode: str
    return_mode: str
    land_mode: str
    take_off_mode: str | None = None
    takes_off_by_mode: bool = False
    boot_modes: frozenset[str]
    landed_modes: frozenset[str]
    item_modes: Mapping[int, str] = field(default_factory=dict)
    return_altitudes: Mapping[str, float]
    return_climbs: Mapping[str, float] = field(default_factory=dict)
    return_ends: Mapping[str, float] = field(default_factory=dict)
    speed_limits: Mapping[str, float]
    own_speeds: Mapping[str, float] = field(default_factory=dict)
    least_speeds: Mapping[str, float] = field(default_factory=dict)
    disarm_delays: Mapping[str, float] = field(default_factory=dict)
    disarmed_modes: frozenset[str] = _NO_MODES
    disarming_s: float = 0.0
    messages: tuple[Any, ...]
    position_is_checked: bool
    texts_prove_failsafe: bool
    failsafe_texts: tuple[tuple[Failsafe, tuple[str, ...]], ...] = _FAILSAFE_TEXTS
    failsafe_charges: frozenset[int] = _FAILSAFE_CHARGES
    mission_texts: tuple[str, ...] = ()
    check_texts: tuple[str, ...]
    checks_s: float
    check_report: int = 0
    checks: Mapping[int, str] = field(default_factory=dict)
    failed_check: Callable[[EventMessage], str | None] = _no_check
    acts_when_critical: bool
    mode_is_checked: bool
    streams_setpoints: bool
    setpoint_loss_modes: frozenset[str] = _NO_MODES
    setpoint_loss_event: int = 0
    paced_setpoints: bool
    take_off_amsl: bool
    unchanged: float
    missions_by_command: bool
    home_first: bool
    keeps_item_radius: bool
    parameter_tolerance: float
    upload_can_be_cancelled: bool
    first_port: int
    port_step: int

    def problem(self, kind: int, autopilot: int) -> str | None:
        """Return why a vehicle is not one of this autopilot; None if it is.

        Args:
            kind: HEARTBEAT.type.
            autopilot: HEARTBEAT.autopilot.
        """
        if autopilot != self.number:
            wanted, name = (
                enum_name("MAV_AUTOPILOT", number) for number in (self.number, autopilot)
            )
            return f"HEARTBEAT.autopilot must be {wanted} with autopilot:={self.name}, got {name}"
        if kind not in self.kinds:
            return f"HEARTBEAT.type must be {self.kind}, got {enum_name('MAV_TYPE', kind)}"
        return None

    @property
    def circles(self) -> bool:
        """Whether it cannot hover."""
        return self.circle_m > 0.0

    @property
    def orderly_modes(self) -> frozenset[str]:
        """Modes in which it waits for orders or carries them out."""
        return frozenset({self.guided_mode, self.resting_mode})

    @property
    def take_off_modes(self) -> frozenset[str]:
        """Modes from which, and in which, it takes off."""
        return self.orderly_modes | ({self.take_off_mode} if self.take_off_mode else set())

    @property
    def descent_modes(self) -> frozenset[str]:
        """Modes in which it comes down by itself."""
        return frozenset({self.return_mode, self.land_mode})

    @property
    def mission_modes(self) -> frozenset[str]:
        """Modes in which it flies a mission, and those that the mission's items bring about."""
        return frozenset({self.mission_mode, *self.item_modes.values()})

    @property
    def first_item(self) -> int:
        """Number of the first mission item that is flown; home has the number before."""
        return int(self.home_first)

    def mode_name(self, custom_mode: int) -> str:
        """Return the name of HEARTBEAT.custom_mode; `MODE(n)` if it is unknown."""
        fields = tuple(custom_mode >> shift & self.mode_mask for shift in self.mode_shifts)
        return self.modes.get(fields, f"MODE({'.'.join(map(str, fields))})")

    def mode_parameters(self, mode: str) -> tuple[float, ...]:
        """Return the parameters of MAV_CMD_DO_SET_MODE, from the first one on."""
        fields = next(fields for fields, name in self.modes.items() if name == mode)
        return tuple(map(float, (mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, *fields)))

    def take_off_parameters(self, alt_amsl_m: float, home_amsl_m: float) -> tuple[float, ...]:
        """Return the parameters of MAV_CMD_NAV_TAKEOFF.

        Args:
            alt_amsl_m: Altitude above mean sea level.
            home_amsl_m: Altitude of home above mean sea level.
        """
        altitude_m = alt_amsl_m if self.take_off_amsl else alt_amsl_m - home_amsl_m
        return (0.0, 0.0, 0.0, self.unchanged, self.unchanged, self.unchanged, altitude_m)

    def connections(self, number: int) -> list[str]:
        """Return the default connections of this number of simulated vehicles."""
        ports = (self.first_port + self.port_step * index for index in range(number))
        return [f"udpin:127.0.0.1:{port}" for port in ports]

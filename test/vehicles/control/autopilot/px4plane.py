# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The behaviour of PX4's fixed wing."""

from __future__ import annotations

import math
from typing import ClassVar

from .commands import ACCEPTED, Command
from .fixed_wing import Circle, Fly, Glide
from .local_frame import Point
from .maneuvers import Hold
from .parameters import Number
from .px4 import Mode, Px4
from .settings import Settings
from .wire import Message, mavlink

_TOO_LOW_M = 3.0
"""How much lower than it is to, it circles."""
_NO_PLACE, _NO_SETPOINTS = "check_modes_local_pos", "check_modes_offboard_signal"


class Px4Plane(Px4):
    """A vehicle that behaves as PX4's fixed wing does.

    In OFFBOARD it flies to positions, circles over the last one, and ignores velocities with them.
    """

    kind = mavlink.MAV_TYPE_FIXED_WING
    falls = Glide
    blind_flags, blind_s = 319, 7.0
    """ESTIMATOR_STATUS.flags without GPS, and how much later than the loss."""
    dead_reckons_s = 32.0
    """Time without GPS after which it does not know its position, and returns."""
    default_parameters: ClassVar[dict[str, Number]] = {
        **Px4.default_parameters,
        "FW_AIRSPD_MAX": 30.0,
        "FW_AIRSPD_MIN": 10.0,
        "FW_AIRSPD_TRIM": 15.0,
        "NAV_LOITER_RAD": 80.0,
        "RTL_RETURN_ALT": 100.0,
    }

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        self._blind_s = self._lost_s = math.inf

    @property
    def ekf_flags(self) -> int:
        return self.blind_flags if self.time_s >= self._blind_s else super().ekf_flags

    def lose_gps(self) -> None:
        """Fly on by airspeed; position, modes and checks are still good."""
        self._blind_s = self.time_s + self.blind_s
        self._lost_s = self.time_s + self.dead_reckons_s

    @property
    def _failed_checks(self) -> list[tuple[str, int, int]]:
        failed = super()._failed_checks
        if "position" not in self.failsafes:
            return failed
        # Without a position it counts no setpoint as one; HOLD and RTL go on by dead reckoning.
        kept = [check for check in failed if check[0] != _NO_SETPOINTS]
        severity = mavlink.MAV_SEVERITY_ERROR
        return [(_NO_PLACE, 0b111 << 19, severity), *kept, (_NO_SETPOINTS, 1 << 14, severity)]

    def _circle(self, target: Point) -> Circle:
        target = target._replace(up_m=target.up_m - _TOO_LOW_M)
        return Circle(target, self.cruise_mps, self.parameters["NAV_LOITER_RAD"])

    @property
    def cruise_mps(self) -> float:
        """Airspeed."""
        return self.parameters["FW_AIRSPD_TRIM"]

    def _enter_mode(self) -> None:
        here = self.craft.point
        self.mission.active = False
        if self.landed:
            self.maneuver = Hold()
        elif self.mode in (Mode.RTL, Mode.LAND):
            self.maneuver = self._circle(self.home._replace(up_m=self.parameters["RTL_RETURN_ALT"]))
        else:
            self.maneuver = self._circle(here)

    def _nav_takeoff(self, command: Command) -> int:
        result = super()._nav_takeoff(command)
        if result == ACCEPTED:
            up_m = command.z - self.frame.home.alt_amsl_m
            self.maneuver = TakingOff(up_m if math.isfinite(up_m) else 30.0, self.cruise_mps)
        return result

    def arm(self, *, force: bool) -> int:
        taking_off = self.maneuver
        result = super().arm(force=force)
        if result == ACCEPTED and isinstance(taking_off, TakingOff):
            self.maneuver = taking_off
        return result

    def _fly_to_setpoint(self, message: Message) -> None:
        target = self._target(message)
        if target is not None and target.within_reach:
            self.maneuver = self._circle(target)

    def tick(self) -> None:
        if self.time_s >= self._lost_s:
            self._lost_s = math.inf
            self.failsafes.add("position")
            self._set_failsafe_mode(Mode.RTL)
        super().tick()
        climbing = isinstance(self.maneuver, TakingOff) and self.mode is Mode.TAKEOFF
        if climbing and self.maneuver.has_risen(self):
            self._set_intended_mode(Mode.HOLD)
            self._enter_mode()


class TakingOff(Fly):
    """Take off straight ahead, up to a height."""

    landed_state = mavlink.MAV_LANDED_STATE_TAKEOFF

    def has_risen(self, vehicle: Px4Plane) -> bool:
        """Whether the vehicle is up there."""
        return vehicle.craft.up_m >= self._up_m - 1.0

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The behaviour of ArduPlane 4.5, a fixed wing."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any, ClassVar

from .ardupilot import ArduCopter
from .channel import Sender
from .commands import ACCEPTED, FAILED, Command
from .fixed_wing import Circle, Fly, Glide
from .local_frame import Point
from .maneuvers import Maneuver
from .parameters import Number
from .settings import Settings
from .wire import Message, mavlink

_SPEED_MPS, _RADIUS_M = 22.0, 60.0


class Mode(IntEnum):
    """HEARTBEAT.custom_mode."""

    MANUAL = 0
    STABILIZE = 2
    AUTO = 10
    RTL = 11
    LOITER = 12
    TAKEOFF = 13
    GUIDED = 15


class ArduPlane(ArduCopter):
    """A vehicle that behaves as ArduPlane does."""

    kind = mavlink.MAV_TYPE_FIXED_WING
    default_parameters: ClassVar[dict[str, Number]] = {
        **ArduCopter.default_parameters,
        "RTL_ALTITUDE": 100.0,
        "RTL_CLIMB_MIN": 0.0,
        "ARSPD_FBW_MAX": 30.0,
        "ARSPD_FBW_MIN": 10.0,
        "TKOFF_ALT": 50.0,
        "TRIM_ARSPD_CM": 100.0 * _SPEED_MPS,
        "WP_LOITER_RAD": 60.0,
    }
    not_guided = FAILED
    falls = Glide
    blind_flags, blind_s = 303, 10.5
    mode: Any

    @staticmethod
    def go_to(target: Point) -> Circle:
        """Return the maneuver that leads to a place."""
        return Circle(target, _SPEED_MPS, _RADIUS_M)

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        self.mode = Mode.MANUAL

    def _own_parameters(self) -> Mapping[str, Number]:
        return {"SYSID_THISMAV": self.settings.system}

    @property
    def base_mode(self) -> int:
        guided = self.mode in (Mode.AUTO, Mode.RTL, Mode.LOITER, Mode.TAKEOFF, Mode.GUIDED)
        return mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED | (
            mavlink.MAV_MODE_FLAG_GUIDED_ENABLED if guided else 0
        )

    def set_mode_number(self, custom_mode: int) -> int:
        try:
            mode = Mode(custom_mode)
        except ValueError:
            return FAILED
        return ACCEPTED if self.set_mode(mode) else FAILED

    def set_mode(self, mode: Any) -> bool:
        return super().set_mode(Mode[mode.name])  # type: ignore[arg-type]

    def _mode_problem(self, mode: Any) -> str:
        return "" if self.has_position or mode in (Mode.MANUAL, Mode.STABILIZE) else "no position"

    def _enter_mode(self) -> None:
        here = self.craft.point
        if self.mode is Mode.TAKEOFF:
            self.maneuver = Fly(self.home.up_m + self.parameters["TKOFF_ALT"], _SPEED_MPS)
        elif self.landed:
            self.maneuver = Maneuver()
        elif self.mode is Mode.RTL:
            above_m = self.parameters["RTL_ALTITUDE"]
            up_m = self.home.up_m + above_m if above_m >= 0 else here.up_m
            self.maneuver = self.go_to(self.home._replace(up_m=up_m))
        elif self.mode in (Mode.LOITER, Mode.GUIDED):
            self.maneuver = self.go_to(here)
        else:
            self.maneuver = Fly(here.up_m, _SPEED_MPS)

    def position_failsafe(self) -> None:
        """Fly on by dead reckoning, in its mode and without a text."""

    @property
    def seems_to_fly(self) -> bool:
        return not self.landed or self.craft.up_m > 0.0

    @property
    def system_status(self) -> int:
        return mavlink.MAV_STATE_ACTIVE if self.seems_to_fly else super().system_status

    def tick(self) -> None:
        super().tick()
        if not self.armed:
            # Home goes along with what is disarmed, in the air too.
            self.home = self.craft.point

    def arm(self, *, force: bool) -> int:
        if not self.ready and not force:
            self.send_text(f"Arm: {self._unready}", mavlink.MAV_SEVERITY_CRITICAL)
            return FAILED
        self.send_text("Throttle armed")
        self.start_motors()
        self.home = self.craft.point
        self._enter_mode()
        self.broadcast_home()
        return ACCEPTED

    def _nav_takeoff(self, command: Command) -> int:
        # Only with vertical take-off.
        return FAILED

    def set_position_target(self, message: Message, sender: Sender) -> None:
        """Do nothing: it takes altitudes alone."""

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The behaviour of ArduPlane 4.5, a fixed wing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import IntEnum
from typing import Any, ClassVar

from .ardupilot import ArduCopter
from .channel import Sender
from .commands import ACCEPTED, FAILED, Command
from .local_frame import Point
from .maneuvers import Maneuver
from .parameters import Number
from .settings import Settings
from .vehicle import Vehicle
from .wire import Message, mavlink

_SPEED_MPS, _RADIUS_M, _CLIMB_MPS = 22.0, 60.0, 4.0
_TIGHTEST_M = 50.0
"""Radius of a turn at the greatest bank."""
_SPOOL_UP_S = 1.0


class Mode(IntEnum):
    """HEARTBEAT.custom_mode."""

    MANUAL = 0
    STABILIZE = 2
    AUTO = 10
    RTL = 11
    LOITER = 12
    TAKEOFF = 13
    GUIDED = 15


class Fly(Maneuver):
    """Fly straight on, and climb to a height; from the ground, take off."""

    def __init__(self, up_m: float) -> None:
        self._up_m = up_m
        self._spool_s = _SPOOL_UP_S

    def wanted_rad(self, vehicle: Vehicle) -> float:
        """Return where to fly, clockwise from north."""
        return vehicle.craft.heading_rad

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        craft = vehicle.craft
        if vehicle.landed:
            self._spool_s -= dt_s
            if self._spool_s > 0:
                return
            vehicle.lift_off()
        turn = (self.wanted_rad(vehicle) - craft.heading_rad + math.pi) % (2 * math.pi) - math.pi
        most = _SPEED_MPS / _TIGHTEST_M * dt_s
        heading = craft.heading_rad + min(max(turn, -most), most)
        craft.heading_rad = heading
        craft.north_mps, craft.east_mps = (
            _SPEED_MPS * math.cos(heading), _SPEED_MPS * math.sin(heading)
        )  # fmt: skip
        climb_m = min(max(self._up_m - craft.up_m, -_CLIMB_MPS * dt_s), _CLIMB_MPS * dt_s)
        craft.up_mps = climb_m / dt_s
        craft.north_m += craft.north_mps * dt_s
        craft.east_m += craft.east_mps * dt_s
        craft.up_m += climb_m


class Circle(Fly):
    """Fly to a place, and circle over it."""

    def __init__(self, target: Point) -> None:
        super().__init__(target.up_m)
        self.target: Point = target

    def wanted_rad(self, vehicle: Vehicle) -> float:
        craft = vehicle.craft
        north_m = self.target.north_m - craft.north_m
        east_m = self.target.east_m - craft.east_m
        away_m, bearing = math.hypot(north_m, east_m), math.atan2(east_m, north_m)
        if away_m > 2 * _RADIUS_M:
            return bearing
        # To the right of the place, further inwards the farther away it is.
        inwards = min(max((away_m - _RADIUS_M) / _RADIUS_M, -1.0), 1.0)
        return bearing - math.pi / 2 * (1.0 - inwards)


class ArduPlane(ArduCopter):
    """A vehicle that behaves as ArduPlane does."""

    kind = mavlink.MAV_TYPE_FIXED_WING
    default_parameters: ClassVar[dict[str, Number]] = {
        **ArduCopter.default_parameters,
        "ALT_HOLD_RTL": 10_000.0,
        "RTL_CLIMB_MIN": 0.0,
        "TKOFF_ALT": 50.0,
        "WP_LOITER_RAD": 60.0,
    }
    not_guided = FAILED
    go_to = Circle
    mode: Any

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
            self.maneuver = Fly(self.home.up_m + self.parameters["TKOFF_ALT"])
        elif self.landed:
            self.maneuver = Maneuver()
        elif self.mode is Mode.RTL:
            up_m = self.home.up_m + self.parameters["ALT_HOLD_RTL"] / 100
            self.maneuver = Circle(self.home._replace(up_m=up_m))
        elif self.mode in (Mode.LOITER, Mode.GUIDED):
            self.maneuver = Circle(here)
        else:
            self.maneuver = Fly(here.up_m)

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

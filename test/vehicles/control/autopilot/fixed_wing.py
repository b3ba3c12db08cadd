# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Maneuvers of a fixed wing, which cannot hover."""

from __future__ import annotations

import math

from .local_frame import Point
from .maneuvers import Fall, Maneuver
from .vehicle import Vehicle

_CLIMB_MPS = 4.0
_TIGHTEST_M = 50.0
"""Radius of a turn at the greatest bank."""
_SPOOL_UP_S = 1.0
_GLIDE_MPS, _GLIDE_SINK_MPS = 8.0, 1.2
_SLOWS_S = 4.0


class Glide(Fall):
    """Glide to the ground with dead motors, and stop there."""

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        craft = vehicle.craft
        if craft.up_m == 0.0:
            craft.stop()
            return
        speed_mps = max(math.hypot(craft.north_mps, craft.east_mps), 1e-3)
        slower = max(_GLIDE_MPS / speed_mps, 1.0 - dt_s / _SLOWS_S)
        craft.north_mps, craft.east_mps = craft.north_mps * slower, craft.east_mps * slower
        sinks_mps = min(craft.up_mps, 0.0) - _GLIDE_SINK_MPS * dt_s / _SLOWS_S
        craft.up_mps = max(sinks_mps, -_GLIDE_SINK_MPS)
        craft.north_m += craft.north_mps * dt_s
        craft.east_m += craft.east_mps * dt_s
        craft.up_m = max(craft.up_m + craft.up_mps * dt_s, 0.0)


class Fly(Maneuver):
    """Fly straight on, and climb to a height; from the ground, take off.

    Args:
        up_m: The height above home.
        speed_mps: Speed, without wind.
    """

    def __init__(self, up_m: float, speed_mps: float) -> None:
        self._up_m, self._speed_mps = up_m, speed_mps
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
        most = self._speed_mps / _TIGHTEST_M * dt_s
        heading = craft.heading_rad + min(max(turn, -most), most)
        craft.heading_rad = heading
        craft.north_mps, craft.east_mps = (
            self._speed_mps * math.cos(heading), self._speed_mps * math.sin(heading)
        )  # fmt: skip
        craft.north_mps += craft.wind_mps[0]
        craft.east_mps += craft.wind_mps[1]
        climb_m = min(max(self._up_m - craft.up_m, -_CLIMB_MPS * dt_s), _CLIMB_MPS * dt_s)
        craft.up_mps = climb_m / dt_s
        craft.north_m += craft.north_mps * dt_s
        craft.east_m += craft.east_mps * dt_s
        craft.up_m += climb_m


class Circle(Fly):
    """Fly to a place, and circle over it.

    Args:
        target: The place.
        speed_mps: Speed, without wind.
        radius_m: Of the circle.
    """

    def __init__(self, target: Point, speed_mps: float, radius_m: float) -> None:
        super().__init__(target.up_m, speed_mps)
        self.target: Point = target
        self._radius_m = radius_m

    def wanted_rad(self, vehicle: Vehicle) -> float:
        craft = vehicle.craft
        north_m = self.target.north_m - craft.north_m
        east_m = self.target.east_m - craft.east_m
        away_m, bearing = math.hypot(north_m, east_m), math.atan2(east_m, north_m)
        if away_m > 2 * self._radius_m:
            return bearing
        # To the right of the place, further inwards the farther away it is.
        inwards = min(max((away_m - self._radius_m) / self._radius_m, -1.0), 1.0)
        return bearing - math.pi / 2 * (1.0 - inwards)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A point that flies with bounded speeds and accelerations."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .local_frame import Point

# Braking is planned with less than what is there, so that it never overshoots.
_PLANNED_BRAKING = 0.55
_AT_REST_M = 0.01


@dataclass(frozen=True)
class Limits:
    """What the vehicle may do.

    Attributes:
        speed_mps: Over ground.
        acceleration_mps2: Over ground.
        climb_mps: Upwards.
        descent_mps: Downwards, a positive number.
        vertical_mps2: Acceleration up and down.
    """

    speed_mps: float
    acceleration_mps2: float
    climb_mps: float
    descent_mps: float
    vertical_mps2: float


def _approach(distance_m: float, speed_mps: float, acceleration_mps2: float, dt_s: float) -> float:
    """Return the greatest speed from which it still stops at the end of the distance."""
    braking = math.sqrt(2.0 * _PLANNED_BRAKING * acceleration_mps2 * distance_m)
    return min(speed_mps, braking, distance_m / dt_s)


class PointMass:
    """Position and velocity in metres and metres per second, north, east and up of home.

    Args:
        wind_mps: Wind to the north and to the east, through which it is no faster than over ground.
    """

    def __init__(self, wind_mps: tuple[float, float] = (0.0, 0.0)) -> None:
        self.wind_mps = wind_mps
        self.north_m = self.east_m = self.up_m = 0.0
        self.north_mps = self.east_mps = self.up_mps = 0.0
        self.heading_rad = 0.0

    @property
    def point(self) -> Point:
        """Where it is."""
        return Point(self.north_m, self.east_m, self.up_m)

    @property
    def ground_speed_mps(self) -> float:
        """Speed over ground."""
        return math.hypot(self.north_mps, self.east_mps)

    def distance_m(self, target: Point) -> float:
        """Distance over ground."""
        return math.hypot(target.north_m - self.north_m, target.east_m - self.east_m)

    def stop(self, up_m: float | None = None) -> None:
        """Be at rest at once, at another height if one is given."""
        self.north_mps = self.east_mps = self.up_mps = 0.0
        if up_m is not None:
            self.up_m = up_m

    def fly_towards(self, target: Point, limits: Limits, dt_s: float) -> None:
        """Move for a while towards a point, to come to rest there; the height is independent."""
        north_m, east_m = target.north_m - self.north_m, target.east_m - self.east_m
        distance_m = math.hypot(north_m, east_m)
        north_mps = east_mps = up_mps = 0.0
        if distance_m > _AT_REST_M:
            speed_mps = _approach(distance_m, limits.speed_mps, limits.acceleration_mps2, dt_s)
            north_mps = north_m / distance_m * speed_mps
            east_mps = east_m / distance_m * speed_mps
        up_m = target.up_m - self.up_m
        if abs(up_m) > _AT_REST_M:
            most_mps = limits.climb_mps if up_m > 0 else limits.descent_mps
            up_mps = math.copysign(_approach(abs(up_m), most_mps, limits.vertical_mps2, dt_s), up_m)
        self.fly_with(north_mps, east_mps, up_mps, limits, dt_s)

    def fly_with(
        self, north_mps: float, east_mps: float, up_mps: float, limits: Limits, dt_s: float
    ) -> None:
        """Move for a while, turning the velocity into the one that is wanted, if it may."""
        speed_mps = math.hypot(north_mps, east_mps)
        if speed_mps > limits.speed_mps:
            north_mps *= limits.speed_mps / speed_mps
            east_mps *= limits.speed_mps / speed_mps
        wind_north, wind_east = self.wind_mps
        air_mps = math.hypot(north_mps - wind_north, east_mps - wind_east)
        if air_mps > limits.speed_mps:
            # As ArduCopter does it at its greatest lean: 2 m/s against a wind of 8, at 10.
            share = limits.speed_mps / air_mps
            north_mps = wind_north + share * (north_mps - wind_north)
            east_mps = wind_east + share * (east_mps - wind_east)
        up_mps = max(-limits.descent_mps, min(limits.climb_mps, up_mps))
        north, east = north_mps - self.north_mps, east_mps - self.east_mps
        wanted, allowed = math.hypot(north, east), limits.acceleration_mps2 * dt_s
        share = allowed / wanted if wanted > allowed else 1.0
        self.north_mps += share * north
        self.east_mps += share * east
        allowed = limits.vertical_mps2 * dt_s
        self.up_mps += max(-allowed, min(allowed, up_mps - self.up_mps))
        self.north_m += self.north_mps * dt_s
        self.east_m += self.east_mps * dt_s
        self.up_m += self.up_mps * dt_s
        if abs(self.north_mps) + abs(self.east_mps) > 0.5:
            self.heading_rad = math.atan2(self.east_mps, self.north_mps)

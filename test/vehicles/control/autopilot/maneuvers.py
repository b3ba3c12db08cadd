# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Maneuvers of the vehicle; a mode chooses among these."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from .local_frame import Point
from .wire import mavlink

if TYPE_CHECKING:
    from .point_mass import Limits
    from .vehicle import Vehicle

_SPOOL_UP_S = 1.2
_LAND_DETECTION_S = 2.0
_REACHED_M = 0.3
_GRAVITY_MPS2 = 9.81
_FALL_MPS = 14.7
"""As fast as ArduCopter's model falls with its motors off."""
_POSITION_GAIN = 0.95
"""PX4's MPC_XY_P."""


class Maneuver:
    """Something to do; on its own, nothing.

    Attributes:
        target: Where it leads, if to a place.
        landed_state: MAV_LANDED_STATE while it is done in the air.
    """

    target: Point | None = None
    landed_state = mavlink.MAV_LANDED_STATE_IN_AIR

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        """Fly for a while; called while the vehicle is armed."""


class Hold(Maneuver):
    """Stop and stay.

    Args:
        here: The place that it reports as its target; None if it reports none.
    """

    def __init__(self, here: Point | None = None) -> None:
        self.target = here

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        if not vehicle.landed:
            vehicle.craft.fly_with(0.0, 0.0, 0.0, vehicle.limits, dt_s)


class GoTo(Maneuver):
    """Fly to a place and stay there; it lifts nothing off the ground."""

    def __init__(self, target: Point) -> None:
        self.target: Point = target

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        if not vehicle.landed:
            vehicle.craft.fly_towards(self.target, vehicle.limits, dt_s)

    def within(self, vehicle: Vehicle, radius_m: float) -> bool:
        """Whether the vehicle is as near as that, in height too."""
        height_m = abs(self.target.up_m - vehicle.craft.up_m)
        return max(vehicle.craft.distance_m(self.target), height_m) <= radius_m


class CarriedAway(GoTo):
    """Fly to a place against a wind that is too strong.

    Args:
        target: The place.
        north_mps: Velocity over ground, likewise the next.
    """

    def __init__(self, target: Point, north_mps: float, east_mps: float) -> None:
        super().__init__(target)
        self._velocity = (north_mps, east_mps)

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        vehicle.craft.fly_with(*self._velocity, 0.0, vehicle.limits, dt_s)


class Fall(Maneuver):
    """Fall to the ground with dead motors, and lie there."""

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        craft = vehicle.craft
        craft.up_mps = max(craft.up_mps - _GRAVITY_MPS2 * dt_s, -_FALL_MPS)
        craft.up_m = max(craft.up_m + craft.up_mps * dt_s, 0.0)
        if craft.up_m == 0.0:
            craft.stop()


class Velocity(Maneuver):
    """Fly with a velocity until a time, then stop."""

    def __init__(self, north_mps: float, east_mps: float, up_mps: float, until_s: float) -> None:
        finite = all(map(math.isfinite, (north_mps, east_mps, up_mps)))
        self._velocity = (north_mps, east_mps, up_mps) if finite else (0.0, 0.0, 0.0)
        self._until_s = until_s

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        if not vehicle.landed:
            wanted = self._velocity if vehicle.time_s < self._until_s else (0.0, 0.0, 0.0)
            vehicle.craft.fly_with(*wanted, vehicle.limits, dt_s)


class Track(Maneuver):
    """Follow a place that moves, as PX4's position controller does.

    Args:
        target: The place.
        north_mps: Velocity of the place, likewise the next.
        limits: What may be flown.
    """

    def __init__(self, target: Point, north_mps: float, east_mps: float, limits: Limits) -> None:
        self.target: Point = target
        self._velocity = (north_mps, east_mps)
        self._limits = limits

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        if vehicle.landed:
            return
        craft = vehicle.craft
        north_mps = self._velocity[0] + _POSITION_GAIN * (self.target.north_m - craft.north_m)
        east_mps = self._velocity[1] + _POSITION_GAIN * (self.target.east_m - craft.east_m)
        up_mps = _POSITION_GAIN * (self.target.up_m - craft.up_m)
        craft.fly_with(north_mps, east_mps, up_mps, self._limits, dt_s)


class Follow(Maneuver):
    """Follow a place that moves on by itself, as ArduCopter does; it reports no target.

    Args:
        place: The place now.
        north_mps: Velocity of the place, likewise the next.
        until_s: When the vehicle stops for want of another place.
    """

    def __init__(self, place: Point, north_mps: float, east_mps: float, until_s: float) -> None:
        self._place = place
        self._velocity = (north_mps, east_mps)
        self._until_s = until_s

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        if vehicle.landed:
            return
        craft, place, (north_mps, east_mps) = vehicle.craft, self._place, self._velocity
        if vehicle.time_s >= self._until_s:
            craft.fly_with(0.0, 0.0, 0.0, vehicle.limits, dt_s)
            return
        self._place = place = place._replace(
            north_m=place.north_m + north_mps * dt_s, east_m=place.east_m + east_mps * dt_s
        )
        craft.fly_with(
            north_mps + place.north_m - craft.north_m,
            east_mps + place.east_m - craft.east_m,
            place.up_m - craft.up_m,
            vehicle.limits,
            dt_s,
        )


class TakeOff(Maneuver):
    """Climb straight up to a height and stay there.

    Args:
        here: Where from.
        up_m: Height above home.
        climb_mps: Speed, if not the usual one.
    """

    landed_state = mavlink.MAV_LANDED_STATE_TAKEOFF

    def __init__(self, here: Point, up_m: float, climb_mps: float | None = None) -> None:
        self.target: Point = here._replace(up_m=up_m)
        self.done = False
        self._climb_mps = climb_mps
        self._spool_s = _SPOOL_UP_S

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        if vehicle.landed:
            self._spool_s -= dt_s
            if self._spool_s > 0:
                return
            vehicle.lift_off()
        limits = vehicle.limits
        if self._climb_mps is not None:
            limits = replace(limits, climb_mps=self._climb_mps)
        vehicle.craft.fly_towards(self.target, limits, dt_s)
        self.done = abs(self.target.up_m - vehicle.craft.up_m) < _REACHED_M
        if self.done:
            self.landed_state = mavlink.MAV_LANDED_STATE_IN_AIR


class Land(Maneuver):
    """Descend to the ground, slower near to it.

    Args:
        final_up_m: Height below which it is slow.
        final_mps: Speed there.
    """

    landed_state = mavlink.MAV_LANDED_STATE_LANDING

    def __init__(self, final_up_m: float, final_mps: float) -> None:
        self.done = False
        self._final_up_m = final_up_m
        self._final_mps = final_mps
        self._still_s = 0.0

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        craft, limits = vehicle.craft, vehicle.limits
        if craft.up_m > 0.0 and not vehicle.landed:
            fast = craft.up_m > self._final_up_m
            down_mps = limits.descent_mps if fast else self._final_mps
            craft.fly_with(0.0, 0.0, -down_mps, limits, dt_s)
            return
        craft.stop(up_m=0.0)
        self._still_s += dt_s
        if self._still_s >= _LAND_DETECTION_S and not self.done:
            self.done = True
            vehicle.touch_down()


class Return(Maneuver):
    """Climb, fly home and land there.

    Args:
        here: Where from.
        home: Where to.
        up_m: Height above home of the way; nothing descends to it.
        descend_to_up_m: Height above home to go down to before the wait, if any.
        wait_s: Time to wait over home.
        land: How to land.
        near_m: How near to home it begins to descend, whatever its speed.
    """

    def __init__(
        self,
        here: Point,
        home: Point,
        up_m: float,
        descend_to_up_m: float | None,
        wait_s: float,
        land: Land,
        near_m: float = _REACHED_M,
    ) -> None:
        self._near_m = near_m
        top_m = max(here.up_m, home.up_m + up_m)
        over_home = home._replace(up_m=top_m)
        self._legs = [here._replace(up_m=top_m), over_home]
        if descend_to_up_m is not None:
            self._legs.append(over_home._replace(up_m=min(top_m, home.up_m + descend_to_up_m)))
        self._wait_s = wait_s
        self._land = land
        self.target = self._legs[0]

    @property
    def done(self) -> bool:
        """Whether it is on the ground."""
        return self._land.done

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        if vehicle.landed:
            self._legs.clear()
            self._wait_s = 0.0
        if self._legs:
            leg = GoTo(self._legs[0])
            self.target = leg.target
            leg.step(vehicle, dt_s)
            if leg.within(vehicle, self._near_m):
                self._legs.pop(0)
        elif self._wait_s > 0:
            self._wait_s -= dt_s
            vehicle.craft.fly_with(0.0, 0.0, 0.0, vehicle.limits, dt_s)
        else:
            self.landed_state = self._land.landed_state
            self._land.step(vehicle, dt_s)

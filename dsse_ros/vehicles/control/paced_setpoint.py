# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A setpoint that leads a vehicle along a track at a given speed."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace

from dsse_ros.vehicles.mavlink.messages import SetPositionTarget
from dsse_ros.world.scenario.geodesy import between, offset_m

Place = tuple[float, float]
"""Latitude and longitude, in degrees."""

AHEAD_M = 250.0
"""How far the place to which a fixed wing flies is ahead of it: farther than its circle."""
_LEAD_S = 1.0
"""Greatest lead: longer than the age of the position, short enough not to make the vehicle
accelerate."""
_APPROACH_S = 1.0
"""Time before the end at which the setpoint is the end itself, where the vehicle stops."""
BRAKING_MPS2 = 2.0
"""Deceleration before the end: ArduCopter, with WPNAV_ACCEL of 2.5 m/s2, flies past an end before
which it has to brake harder, and back."""


class PacedSetpoint:
    """A setpoint that moves along a track, with its velocity as feed-forward: carrot chasing.

    Args:
        target: The end of the track; its altitude is the setpoint's from the start.
        speed_mps: Speed over ground, more than 0.
        places: The track up to its end; the vehicle need not be on it.
        boot_s: The vehicle's own clock.
        at: Where the setpoint begins; by default at the start of the track.

    Attributes:
        at_m: How far it has come along the track.
        flown_m: How far the vehicle has; it only grows.
    """

    def __init__(
        self,
        target: SetPositionTarget,
        speed_mps: float,
        places: Sequence[Place],
        boot_s: float,
        at: Place | None = None,
    ) -> None:
        self.target = target
        self._speed_mps = speed_mps
        self._places = [*places, (target.lat_deg, target.lon_deg)]
        self._points = [offset_m(places[0], place) for place in self._places]
        steps_m = [math.dist(a, b) for a, b in itertools.pairwise(self._points)]
        self._at_m = [0.0, *itertools.accumulate(steps_m)]
        self._boot_s = boot_s
        self.at_m = 0.0 if at is None else self._along_m(at, 0.0, self.length_m)
        self.flown_m = 0.0

    @property
    def length_m(self) -> float:
        """The length of the track."""
        return self._at_m[-1]

    def at_place_m(self, number: int) -> float:
        """Return how far along the track one of its places is."""
        return self._at_m[number]

    def _along_m(self, place: Place, low_m: float, high_m: float) -> float:
        """Return how far along the track, within limits, its nearest point to a place is."""
        x, y = offset_m(self._places[0], place)
        nearest_m, along_m = math.inf, low_m
        for (ax, ay), (bx, by), start_m in zip(
            self._points, self._points[1:], self._at_m, strict=False
        ):
            dx, dy = bx - ax, by - ay
            leg_m = math.hypot(dx, dy)
            first_m, last_m = max(low_m - start_m, 0.0), min(high_m - start_m, leg_m)
            if leg_m == 0.0 or first_m > last_m:
                continue
            along = min(max(((x - ax) * dx + (y - ay) * dy) / leg_m, first_m), last_m)
            away_m = math.hypot(ax + along / leg_m * dx - x, ay + along / leg_m * dy - y)
            if away_m < nearest_m:
                nearest_m, along_m = away_m, start_m + along
        return along_m

    @property
    def place(self) -> Place:
        """Where the setpoint is."""
        leg = self._leg
        length_m = self._at_m[leg + 1] - self._at_m[leg]
        share = (self.at_m - self._at_m[leg]) / length_m if length_m > 0.0 else 1.0
        return between(self._places[leg], self._places[leg + 1], share)

    @property
    def _leg(self) -> int:
        """Number of the leg on which the setpoint is."""
        return min(bisect_right(self._at_m, self.at_m), len(self._points) - 1) - 1

    def advance(self, place: Place, boot_s: float) -> SetPositionTarget:
        """Return the setpoint at a time of the vehicle's clock; it waits for one that lags.

        Args:
            place: Where the vehicle is.
            boot_s: The time.
        """
        lead_m = self._speed_mps * _LEAD_S
        # A track may cross itself: the vehicle is near where it was.
        self.flown_m = flown_m = self._along_m(place, self.flown_m, self.at_m + lead_m)
        # A clock that has gone back was restarted.
        passed_s = max(boot_s - self._boot_s, 0.0)
        self._boot_s = boot_s
        left_m = max(self.length_m - flown_m, 0.0)
        speed_mps = min(self._speed_mps, math.sqrt(2.0 * BRAKING_MPS2 * left_m))
        if speed_mps < self._speed_mps:
            # With a lead the vehicle would not brake.
            self.at_m = flown_m
        else:
            at_m = min(self.at_m + speed_mps * passed_s, flown_m + lead_m)
            self.at_m = max(self.at_m, at_m)
        if max(self.at_m, flown_m + speed_mps * _APPROACH_S) >= self.length_m:
            return self.target
        (lat_deg, lon_deg), leg = self.place, self._leg
        (north_m, east_m), (to_north_m, to_east_m) = self._points[leg : leg + 2]
        per_m = speed_mps / (self._at_m[leg + 1] - self._at_m[leg])
        velocity = ((to_north_m - north_m) * per_m, (to_east_m - east_m) * per_m)
        return replace(self.target, lat_deg=lat_deg, lon_deg=lon_deg, velocity_mps=velocity)


class LeadingSetpoint(PacedSetpoint):
    """A place on a track, ahead of a fixed wing, which flies straight towards it.

    It is so far ahead that the vehicle does not circle over it. The speed is the vehicle's own.
    """

    def advance(self, place: Place, boot_s: float) -> SetPositionTarget:
        """See `PacedSetpoint`."""
        self.flown_m = self._along_m(place, self.flown_m, self.flown_m + AHEAD_M)
        self.at_m = min(self.flown_m + AHEAD_M, self.length_m)
        lat_deg, lon_deg = self.place
        return replace(self.target, lat_deg=lat_deg, lon_deg=lon_deg)

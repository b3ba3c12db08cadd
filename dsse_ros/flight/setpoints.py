# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Setpoints that lead a vehicle to a place: streamed, or sent until the vehicle confirms them."""

from __future__ import annotations

import math
from dataclasses import replace

from dsse_ros.flight.commands import OrderFailedError, Situation
from dsse_ros.mavlink.messages import SetPositionTarget

_TARGET_DEG = 1e-5
_TARGET_ALT_M = 1.0
_TARGET_STALE_S = 5.0
_HOME_GAIN = 0.05
_METRES_PER_DEGREE = 111_195.0


class SetpointStreamer:
    """Keeps a vehicle on its way to a place: by a stream of setpoints, or until it confirms one.

    Args:
        situation: Of the vehicle.

    Attributes:
        target: Where it is to fly; None for nowhere.
    """

    def __init__(self, situation: Situation) -> None:
        self._situation = situation
        self._autopilot = situation.autopilot
        self.target: SetPositionTarget | None = None
        self._set_s = 0.0
        self._streaming_since_s = 0.0
        self._due_s = -math.inf
        self._tries = 0
        self._paced: PacedSetpoint | None = None
        self._home_amsl_m = math.nan

    def begin(self, *, to_setpoints: bool) -> None:
        """Forget the target of the last order.

        A stream of setpoints that must not end has the vehicle stay where it is.

        Args:
            to_setpoints: Whether the next order has the vehicle fly to setpoints too.
        """
        state = self._situation.state
        streams = self._autopilot.streams_setpoints and self.target is not None
        if streams and to_setpoints and state.has_position:
            self.fly_to(state.lat_deg, state.lon_deg, state.alt_m)
        else:
            self.stop()

    def stop(self) -> None:
        """Send no more setpoints."""
        self.target = None

    def fly_to(self, lat_deg: float, lon_deg: float, alt_m: float) -> None:
        """Have the vehicle fly to a place, at an altitude above home."""
        situation = self._situation
        target = SetPositionTarget(situation.target, lat_deg, lon_deg, float(alt_m))
        if self.target is None:
            self._streaming_since_s = situation.now
        if target != self.target:
            self.target = target
            self._set_s = self._due_s = situation.now
            self._tries = 0

    @property
    def deadline(self) -> float:
        """When the next setpoint is due."""
        return self._due_s if self.target is not None else math.inf

    def streamed_for(self, seconds: float) -> bool:
        """Whether there have been setpoints for that long."""
        return self.target is not None and self._situation.now - self._streaming_since_s >= seconds

    @property
    def confirmed(self) -> bool:
        """Whether the vehicle flies to the target, by its own report if there are such."""
        now, state, target = self._situation.now, self._situation.state, self.target
        if self._autopilot.streams_setpoints:
            return state.mode == self._autopilot.guided_mode
        if state.target is None or target is None or state.target_s <= self._set_s:
            return False
        alt_amsl_m = target.alt_m + state.alt_amsl_m - state.alt_m
        return (
            now - state.target_s < _TARGET_STALE_S
            and abs(state.target[0] - target.lat_deg) < _TARGET_DEG
            and abs(state.target[1] - target.lon_deg) < _TARGET_DEG
            and abs(state.target[2] - alt_amsl_m) < _TARGET_ALT_M
        )

    def send(self, *, under_way: bool) -> None:
        """Send the setpoint if it is due.

        Args:
            under_way: Whether an order is; streamed setpoints go on after it.

        Raises:
            OrderFailedError: If the vehicle does not accept it.
        """
        situation, settings = self._situation, self._situation.settings
        if self.target is None or situation.now < self._due_s:
            return
        if self._autopilot.streams_setpoints:
            self._due_s = situation.now + 1 / settings.setpoint_hz
            situation.out.append(self._streamed(self.target))
            return
        self._due_s = situation.now + settings.command_s
        if not under_way or situation.state.mode != self._autopilot.guided_mode:
            return
        if self.confirmed:
            self._tries = 0
            return
        if self._tries >= settings.command_tries:
            fence = ": its own geofence is enabled" if situation.state.fenced else ""
            raise OrderFailedError(
                f"the vehicle does not accept its target{fence}{situation.recent_texts()}"
            )
        self._tries += 1
        situation.out.append(self.target)

    def _streamed(self, target: SetPositionTarget) -> SetPositionTarget:
        """Return the setpoint that leads to the target, at the speed that is asked for."""
        state, speed_mps = self._situation.state, self._situation.settings.speed_mps
        if not state.has_position:
            return target
        place = (state.lat_deg, state.lon_deg)
        if speed_mps > 0 and self._autopilot.paced_setpoints:
            if state.mode != self._autopilot.guided_mode:
                # Hold its position until its mode shows that it follows setpoints.
                self._paced = None
                target = replace(target, lat_deg=state.lat_deg, lon_deg=state.lon_deg)
            else:
                if self._paced is None or self._paced.target != target:
                    self._paced = PacedSetpoint(target, speed_mps, place, state.boot_s)
                target = self._paced.advance(place, state.boot_s)
        if not self._autopilot.altitudes_amsl:
            return target
        # PX4 moves its home by up to a metre in the first minutes of a flight: hence the mean.
        home_m = state.alt_amsl_m - state.alt_m
        if not math.isfinite(self._home_amsl_m):
            self._home_amsl_m = home_m
        self._home_amsl_m += _HOME_GAIN * (home_m - self._home_amsl_m)
        return replace(target, alt_m=target.alt_m + self._home_amsl_m, above_sea=True)


class PacedSetpoint:
    """A setpoint that leads a vehicle along a straight leg at a given speed: carrot chasing.

    This is how `Autopilot.paced_setpoints` are flown, with the velocity as feed-forward.

    Args:
        target: The end of the leg; its altitude is the setpoint's from the start.
        speed_mps: Speed over ground, more than 0.
        place: Latitude and longitude of the vehicle in degrees.
        boot_s: The vehicle's own clock.
    """

    _LEAD_S = 1.0
    """Greatest lead: longer than the age of the position, short enough not to make the vehicle
    accelerate."""
    _APPROACH_S = 1.0
    """Time before the end at which the setpoint is the end itself, where the vehicle stops."""

    def __init__(
        self,
        target: SetPositionTarget,
        speed_mps: float,
        place: tuple[float, float],
        boot_s: float,
    ) -> None:
        self.target = target
        self._speed_mps = speed_mps
        self._start = place
        self._at_m = 0.0
        self._boot_s = boot_s
        north_m, east_m = offset_m(place, (target.lat_deg, target.lon_deg))
        self._length_m = math.hypot(north_m, east_m)
        length_m = self._length_m or 1.0
        self._direction = (north_m / length_m, east_m / length_m)

    def advance(self, place: tuple[float, float], boot_s: float) -> SetPositionTarget:
        """Return the setpoint at a time of the vehicle's clock; it waits for one that lags."""
        north_m, east_m = offset_m(self._start, place)
        flown_m = north_m * self._direction[0] + east_m * self._direction[1]
        # A clock that has gone back was restarted.
        passed_s = max(boot_s - self._boot_s, 0.0)
        self._boot_s = boot_s
        lead_m = self._speed_mps * self._LEAD_S
        at_m = min(self._at_m + self._speed_mps * passed_s, flown_m + lead_m)
        self._at_m = max(self._at_m, at_m)
        if max(self._at_m, flown_m + self._speed_mps * self._APPROACH_S) >= self._length_m:
            return self.target
        share = self._at_m / self._length_m
        lat_deg, lon_deg = self._start
        east_deg = (self.target.lon_deg - lon_deg + 180) % 360 - 180
        return replace(
            self.target,
            lat_deg=lat_deg + share * (self.target.lat_deg - lat_deg),
            lon_deg=(lon_deg + share * east_deg + 180) % 360 - 180,
            velocity_mps=(
                self._speed_mps * self._direction[0],
                self._speed_mps * self._direction[1],
            ),
        )


def offset_m(start: tuple[float, float], end: tuple[float, float]) -> tuple[float, float]:
    """Return metres to north and east between places in degrees, exact enough along a leg."""
    north_m = (end[0] - start[0]) * _METRES_PER_DEGREE
    east_deg = (end[1] - start[1] + 180) % 360 - 180
    return north_m, east_deg * _METRES_PER_DEGREE * math.cos(math.radians(start[0]))

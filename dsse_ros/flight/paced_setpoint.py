# SPDX-License-Identifier: Apache-2.0
"""A setpoint that leads a vehicle along a straight leg at a given speed.

PX4 acknowledges MAV_CMD_DO_CHANGE_SPEED in OFFBOARD and flies to a setpoint as fast as it may. It
does keep to a setpoint that moves, with its velocity as feed-forward: carrot chasing.
"""

from __future__ import annotations

import math
from dataclasses import replace

from dsse_ros.flight.mavlink_messages import SetPositionTarget
from dsse_ros.flight.vehicle_state import VehicleState

_LEAD_S = 1.0
"""Greatest lead over the vehicle: more than its position is old, less than makes it run."""
_APPROACH_S = 1.0
"""Time before the end of the leg at which the vehicle gets its end, where it stops by itself."""
_METRES_PER_DEGREE = 111_195.0


class PacedSetpoint:
    """One leg, from where the vehicle is to a target.

    Args:
        target: The end of the leg; its altitude is the setpoint's from the start.
        speed_mps: Speed over ground, more than 0.
        state: Where the vehicle is.
    """

    def __init__(self, target: SetPositionTarget, speed_mps: float, state: VehicleState) -> None:
        self.target = target
        self._speed_mps = speed_mps
        self._start = (state.lat_deg, state.lon_deg)
        self._at_m = 0.0
        self._boot_s = state.boot_s
        north_m, east_m = _offset_m(self._start, (target.lat_deg, target.lon_deg))
        self._length_m = math.hypot(north_m, east_m)
        length_m = self._length_m or 1.0
        self._direction = (north_m / length_m, east_m / length_m)

    def advance(self, state: VehicleState) -> SetPositionTarget:
        """Return the setpoint by the vehicle's own clock; it waits for a vehicle that lags."""
        north_m, east_m = _offset_m(self._start, (state.lat_deg, state.lon_deg))
        flown_m = north_m * self._direction[0] + east_m * self._direction[1]
        # A clock that has gone back began anew.
        passed_s = max(state.boot_s - self._boot_s, 0.0)
        self._boot_s = state.boot_s
        lead_m = self._speed_mps * _LEAD_S
        at_m = min(self._at_m + self._speed_mps * passed_s, flown_m + lead_m)
        self._at_m = max(self._at_m, at_m)
        if max(self._at_m, flown_m + self._speed_mps * _APPROACH_S) >= self._length_m:
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


def _offset_m(start: tuple[float, float], end: tuple[float, float]) -> tuple[float, float]:
    """Return metres to north and east, exact enough for the speed along a leg."""
    north_m = (end[0] - start[0]) * _METRES_PER_DEGREE
    east_deg = (end[1] - start[1] + 180) % 360 - 180
    return north_m, east_deg * _METRES_PER_DEGREE * math.cos(math.radians(start[0]))

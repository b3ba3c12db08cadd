# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether a vehicle flies as fast as planned: it may stand on its track, or fly against a wind."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from dsse_ros.vehicles.control.orders import FlyTrack, GoTo, SearchPlace
from dsse_ros.vehicles.control.vehicle_controller import Order
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.world.scenario.geodesy import offset_m

LEGS = 3
"""Steps over which the speeds are compared."""
LEAST_S = 20.0
"""Least time for that, on the vehicle's clock."""
_SLOW, _FAST_ENOUGH = 0.7, 0.8
"""Shares of the planned speed below which a vehicle is slow, and from which it no longer is."""
_STANDING_MPS = 0.5
"""Speed below which a vehicle on its way to a place, for which no speed is planned, is slow."""
_LONGEST_GAP_S = 5.0


class LegSpeeds(NamedTuple):
    """The mean speeds of a vehicle over its last legs, m/s.

    Attributes:
        planned: Speed over ground; NaN where no speed is planned, as to a place.
        flown: Speed by its positions.
    """

    planned: float
    flown: float


class PaceWatch:
    """Compares how fast a vehicle flies with how fast it should.

    Attributes:
        pace: Its speeds; None while it has not been under way for long enough.
        slow: How slow it is, in words; None if it is not.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begin anew, as the vehicle does not follow its drone."""
        self.pace: LegSpeeds | None = None
        self.slow: str | None = None
        # The time under way, and the way planned and flown in it, m.
        self._ways: deque[tuple[float, float, float]] = deque([(0.0, 0.0, 0.0)])
        self._last: VehicleState | None = None
        self._plans = False

    def update(self, order: Order | None, state: VehicleState, step_s: float) -> None:
        """Take what a vehicle reports that follows its drone.

        Args:
            order: What it should be doing; while that leads nowhere, it is not under way.
            state: What it reports.
            step_s: Time of a step.
        """
        before, planned_mps = self._last, _planned_mps(order, state)
        if planned_mps is None:
            self._last = None
            return
        if before is not None and state.boot_s == before.boot_s:
            return
        plans = planned_mps > 0.0
        if plans is not self._plans:
            self.forget()
            self._plans = plans
        self._last = state
        passed_s = math.nan if before is None else state.boot_s - before.boot_s
        if before is None or not 0.0 < passed_s <= _LONGEST_GAP_S:
            return
        away_m = offset_m((before.lat_deg, before.lon_deg), (state.lat_deg, state.lon_deg))
        moved_m = math.hypot(*away_m, state.alt_m - before.alt_m)
        time_s, planned_m, flown_m = self._ways[-1]
        self._ways.append(
            (time_s + passed_s, planned_m + planned_mps * passed_s, flown_m + moved_m)
        )
        self._compare(state, max(LEGS * step_s, LEAST_S))

    def _compare(self, state: VehicleState, span_s: float) -> None:
        ways, (now_s, planned_m, flown_m) = self._ways, self._ways[-1]
        while len(ways) > 2 and now_s - ways[1][0] >= span_s:
            ways.popleft()
        since_s = now_s - ways[0][0]
        if since_s < span_s:
            return
        planned = (planned_m - ways[0][1]) / since_s if self._plans else math.nan
        flown = (flown_m - ways[0][2]) / since_s
        self.pace = LegSpeeds(planned, flown)
        share = _FAST_ENOUGH if self.slow else _SLOW
        least = share * planned if self._plans else _STANDING_MPS
        self.slow = None
        if flown < least:
            of_planned = f" of {planned:.1f} planned" if self._plans else " on its way"
            self.slow = f"flies {flown:.1f} m/s{of_planned}{_in_wind(state)}"


def _planned_mps(order: Order | None, state: VehicleState) -> float | None:
    """Return the speed at which a vehicle should fly; 0 for any, None if it may stay."""
    if not state.has_position:
        return None
    if isinstance(order, FlyTrack):
        return order.speed_mps
    if isinstance(order, GoTo | SearchPlace):
        place = (order.lat_deg, order.lon_deg)
        away_m = math.hypot(*offset_m((state.lat_deg, state.lon_deg), place))
        return 0.0 if away_m > order.radius_m else None
    return None


def wind_of(state: VehicleState) -> tuple[float, float]:
    """Return the wind that a vehicle reports: m/s, and degrees from where; NaN if it does not."""
    if state.wind is None:
        return math.nan, math.nan
    east, north = state.wind
    return math.hypot(east, north), math.degrees(math.atan2(-east, -north)) % 360.0


def _in_wind(state: VehicleState) -> str:
    speed, from_deg = wind_of(state)
    if not speed >= 1.0:
        return ""
    return f", in a wind of {speed:.0f} m/s from {from_deg:.0f} degrees"

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether a vehicle in the air leaves its place, the fence, or the air, without an order."""

from __future__ import annotations

import math
from enum import Enum, auto

from dsse_ros.autopilots import Autopilot
from dsse_ros.bridge.fence import Fence, check_horizontal
from dsse_ros.flight.orders import FlyMission, GoTo
from dsse_ros.flight.vehicle_controller import Order
from dsse_ros.flight.vehicle_state import VehicleState
from dsse_ros.scenario.geodesy import offset_m

AWAY_S = 2.0
"""How long a vehicle may be out of its place, or of the fence: a fault of the GPS ends sooner."""
AWAY_M = 5.0
"""How far out of its place, or beyond a limit of altitude, a vehicle may be."""
_OVER_HOME_M = 15.0
_CLIMBS_MPS = 0.3
"""Speed above which a vehicle is certain to climb."""


class Low(Enum):
    """Why a vehicle may be below the lowest altitude."""

    ORDERED = auto()
    """It is ordered to come down."""
    CLIMBING = auto()
    """It takes off."""
    RISEN = auto()
    """It should not be, as it has been at its altitude."""
    UNKNOWN = auto()
    """It may climb, by the order of an earlier program."""


class PlaceWatch:
    """Watches one vehicle, from its take-off to its landing.

    Args:
        circle_m: See `Autopilot`.
    """

    def __init__(self, circle_m: float = 0.0) -> None:
        self._circle_m = circle_m
        self._away_since_s = self._outside_since_s = self._low_since_s = math.inf
        self._highest_amsl_m = -math.inf

    def has_left(self, place: GoTo | None, state: VehicleState, now_s: float) -> bool:
        """Return whether a vehicle has left its place.

        Args:
            place: The place; None if it has not arrived anywhere.
            state: What it reports, with its position.
            now_s: Time on a steady clock.
        """
        away = place is not None and self._is_away(place, state)
        self._away_since_s = _since(self._away_since_s, now_s, when=away)
        return now_s - self._away_since_s >= AWAY_S

    def falls(self, state: VehicleState, now_s: float, fence: Fence, low: Low) -> bool:
        """Return whether a vehicle is below the lowest altitude without an order.

        Args:
            state: What it reports, with its position.
            now_s: Time on a steady clock.
            fence: Has the lowest altitude.
            low: Why it may be below.
        """
        self._highest_amsl_m = max(self._highest_amsl_m, state.alt_amsl_m)
        lost_height = self._highest_amsl_m - state.alt_amsl_m > AWAY_M
        rests = low is Low.UNKNOWN and not state.climb_mps > _CLIMBS_MPS
        falls = low is not Low.ORDERED and (low is Low.RISEN or lost_height or rests)
        below = falls and state.alt_amsl_m < fence.min_amsl_m - AWAY_M
        self._low_since_s = _since(self._low_since_s, now_s, when=below)
        return now_s - self._low_since_s >= AWAY_S

    def outside(self, state: VehicleState, now_s: float, fence: Fence) -> str:
        """Return why a vehicle is outside the fence, once that lasts; empty if it is inside."""
        refused = check_horizontal(state.lat_deg, state.lon_deg, fence)
        why = "" if refused is None else refused.reason
        if not why and state.alt_amsl_m > fence.max_amsl_m + AWAY_M:
            why = f"altitude must be at most {fence.max_amsl_m:g} m, got {state.alt_amsl_m:.0f}"
        self._outside_since_s = _since(self._outside_since_s, now_s, when=bool(why))
        return why if now_s - self._outside_since_s >= AWAY_S else ""

    def _is_away(self, place: GoTo, state: VehicleState) -> bool:
        here, there = (state.lat_deg, state.lon_deg), (place.lat_deg, place.lon_deg)
        radius_m = max(place.radius_m, self._circle_m)
        away_m = math.hypot(*offset_m(here, there)) - radius_m
        return max(away_m, abs(state.alt_amsl_m - place.alt_amsl_m)) > AWAY_M

    @property
    def is_outside(self) -> bool:
        """Whether it was outside the fence when it was looked at last."""
        return self._outside_since_s < math.inf


def waits_over_home(order: Order | None, state: VehicleState, autopilot: Autopilot) -> bool:
    """Return whether a vehicle has flown its mission except for the landing.

    Args:
        order: The order of its task that is due.
        state: What it reports.
        autopilot: Autopilot of the vehicle.
    """
    if not isinstance(order, FlyMission) or order.hold_item < 0 or not state.has_position:
        return False
    if state.mode != autopilot.mission_mode:
        # The item stays the current one if a person ends the mission.
        return False
    item = order.items[order.hold_item]
    away = offset_m((state.lat_deg, state.lon_deg), (item.lat_deg, item.lon_deg))
    return state.item_current == order.hold_item and math.hypot(*away) <= _OVER_HOME_M


def _since(since_s: float, now_s: float, *, when: bool) -> float:
    """Return since when something is the case; infinity while it is not."""
    return min(since_s, now_s) if when else math.inf

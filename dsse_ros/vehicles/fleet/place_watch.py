# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether a vehicle in the air leaves its place, its leg, the fence or the air without an order."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from enum import Enum, auto
from typing import NamedTuple

from dsse_ros.vehicles.autopilots import Autopilot
from dsse_ros.vehicles.control.orders import FlyMission, FlyTrack, GoTo, SearchPlace
from dsse_ros.vehicles.control.paced_setpoint import BRAKING_MPS2, Place
from dsse_ros.vehicles.control.vehicle_controller import Order
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.fence import Fence, check_horizontal
from dsse_ros.vehicles.mission_items.items import FRAME_GLOBAL, NAV_TAKEOFF
from dsse_ros.world.scenario.geodesy import offset_m

AWAY_S = 2.0
"""How long a vehicle may be out of its place, or of the fence: a fault of the GPS ends sooner."""
AWAY_M = 5.0
"""How far out of its place, or beyond a limit of altitude, a vehicle may be."""
BESIDE_M = 30.0
"""How far beside its leg a vehicle on a mission may be: it cuts corners, and winds carry it."""
_STRAYS_S = 5.0
"""How long a vehicle that flies to setpoints may be farther off its leg than it should: it brakes
from the one before, and turns."""
_OVER_HOME_M = 15.0
_CLIMBS_MPS = 0.3
"""Speed above which a vehicle is certain to climb."""


class OrderLeg(NamedTuple):
    """A straight leg, or a column over one place.

    Attributes:
        start: Latitude and longitude of its start, degrees.
        end: Latitude and longitude of its end.
        low_m: Lowest altitude above mean sea level.
        high_m: Highest altitude.
    """

    start: Place
    end: Place
    low_m: float
    high_m: float


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
        self._off_since_s = math.inf
        # The order that is carried out, and where and how fast the vehicle was as it began.
        self._order: Order | None = None
        self._begin: VehicleState | None = None
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

    def strays(
        self, order: Order | None, state: VehicleState, now_s: float, autopilot: Autopilot
    ) -> str | None:
        """Return how a vehicle has left all legs of its order, once that lasts.

        Args:
            order: The order that it carries out: a mission, or one to fly to setpoints.
            state: What it reports, with its position.
            now_s: Time on a steady clock.
            autopilot: Autopilot of the vehicle.
        """
        if order is not self._order:
            self._order, self._begin, self._off_since_s = order, state, math.inf
        why, lasts_s = None, _STRAYS_S
        if isinstance(order, FlyMission):
            legs, lasts_s = _mission_legs(order, state, autopilot), AWAY_S
            why = _off_legs(legs, state, BESIDE_M, AWAY_M)
        elif self._begin is not None and state.mode == autopilot.guided_mode:
            legs = _legs(order, self._begin)
            # A fixed wing turns in a circle, and loses height in it.
            beside_m = BESIDE_M + autopilot.circle_m + self._braking_m(order)
            why = _off_legs(legs, state, beside_m, AWAY_M + 2.0 * autopilot.alt_error_m)
        self._off_since_s = _since(self._off_since_s, now_s, when=bool(why))
        return why if now_s - self._off_since_s >= lasts_s else None

    def _braking_m(self, order: Order | None) -> float:
        """Return how far a vehicle flies on from the leg before, and past each turn of a track."""
        before_mps = 0.0 if self._begin is None else self._begin.speed_mps
        flown_mps = order.speed_mps if isinstance(order, FlyTrack) else 0.0
        speed_mps = max(before_mps if math.isfinite(before_mps) else 0.0, flown_mps)
        return speed_mps**2 / (2.0 * BRAKING_MPS2)

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

    def outside(self, state: VehicleState, now_s: float, fence: Fence) -> str | None:
        """Return why a vehicle is outside the fence, once that lasts."""
        refused = check_horizontal(state.lat_deg, state.lon_deg, fence)
        why = None if refused is None else refused.reason
        if not why and state.alt_amsl_m > fence.max_amsl_m + AWAY_M:
            why = f"altitude must be at most {fence.max_amsl_m:g} m, got {state.alt_amsl_m:.0f}"
        self._outside_since_s = _since(self._outside_since_s, now_s, when=bool(why))
        return why if now_s - self._outside_since_s >= AWAY_S else None

    def _is_away(self, place: GoTo, state: VehicleState) -> bool:
        here, there = (state.lat_deg, state.lon_deg), (place.lat_deg, place.lon_deg)
        radius_m = max(place.radius_m, self._circle_m)
        away_m = math.hypot(*offset_m(here, there)) - radius_m
        return max(away_m, abs(state.alt_amsl_m - place.alt_amsl_m)) > AWAY_M

    @property
    def is_outside(self) -> bool:
        """Whether it was outside the fence when that was checked last."""
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


def _mission_legs(order: FlyMission, state: VehicleState, autopilot: Autopilot) -> list[OrderLeg]:
    """Return the legs of a mission on one of which a vehicle should be; none if none is known.

    The current item is known late, so the legs before and after its own count too.
    """
    items, current = order.items, state.item_current
    placed = [i for i in range(autopilot.first_item, len(items)) if items[i].frame == FRAME_GLOBAL]
    ahead = next((k for k, i in enumerate(placed) if i >= current), None)
    if ahead is None or state.mode != autopilot.mission_mode:
        # It returns, or its items have not been begun.
        return []
    near = [items[i] for i in placed[max(ahead - 2, 0) : ahead + 2]]
    legs = []
    for start, end in itertools.pairwise([near[0], *near]):
        low_m, high_m = sorted((start.alt_m, end.alt_m))
        if start is end and start.command == NAV_TAKEOFF:
            low_m = -math.inf
        a, b = ((item.lat_deg, item.lon_deg) for item in (start, end))
        legs.append(OrderLeg(a, b, low_m, high_m))
    return legs


def _legs(order: Order | None, begin: VehicleState) -> list[OrderLeg]:
    """Return the legs of an order to fly to setpoints; none for any other.

    Args:
        order: The order.
        begin: State of the vehicle as it began.
    """
    if not isinstance(order, GoTo | SearchPlace | FlyTrack):
        return []
    here, level_m = (begin.lat_deg, begin.lon_deg), order.alt_amsl_m
    places: tuple[Place, ...]
    if isinstance(order, FlyTrack):
        places = (*order.places, order.beyond)
    else:
        places = ((order.lat_deg, order.lon_deg),)
    # It climbs or descends on the spot first.
    columns = [(here, begin.alt_amsl_m)]
    if isinstance(order, SearchPlace):
        columns.append((places[0], order.search_amsl_m))
    return [
        *(
            OrderLeg(place, place, min(alt_m, level_m), max(alt_m, level_m))
            for place, alt_m in columns
        ),
        *(OrderLeg(a, b, level_m, level_m) for a, b in itertools.pairwise((here, *places))),
    ]


def _off_legs(
    legs: Sequence[OrderLeg], state: VehicleState, beside_m: float, above_m: float
) -> str | None:
    """Return how a vehicle is off all legs; None if it is on one, or there are none.

    Args:
        legs: The legs.
        state: What it reports, with its position.
        beside_m: How far beside one it may be.
        above_m: How far above or below one it may be.
    """
    offs = []
    for leg in legs:
        up_m = max(state.alt_amsl_m - leg.high_m, 0.0) - max(leg.low_m - state.alt_amsl_m, 0.0)
        offs.append((_beside_m(state, leg.start, leg.end), up_m))
    if not offs:
        return None
    off_m, up_m = min(offs, key=lambda off: max(off[0] - beside_m, abs(off[1]) - above_m))
    if abs(up_m) > above_m:
        return f"{abs(up_m):.0f} m {'above' if up_m > 0 else 'below'} its leg"
    return f"{off_m:.0f} m beside its leg" if off_m > beside_m else None


def _beside_m(state: VehicleState, start: Place, end: Place) -> float:
    """Return the horizontal distance of a vehicle from a leg."""
    here = (state.lat_deg, state.lon_deg)
    (ax, ay), (bx, by) = (offset_m(here, place) for place in (start, end))
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    share = min(max(-(ax * dx + ay * dy) / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
    return math.hypot(ax + share * dx, ay + share * dy)


def _since(since_s: float, now_s: float, *, when: bool) -> float:
    """Return since when something is the case; infinity while it is not."""
    return min(since_s, now_s) if when else math.inf

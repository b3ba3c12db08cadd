# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keeps the vehicles of a search apart: decides which orders are allowed while others fly.

Each vehicle flies in its own layer. If one leaves its layer, to take off, to search or to come
down, the others stay away from the column below, or it waits for them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from dsse_ros.flight.orders import FlyMission, GoTo, Land, Return, Search, TakeOff
from dsse_ros.flight.vehicle_controller import Order
from dsse_ros.flight.vehicle_state import VehicleState
from msg_adapters.frames import GridFrame
from msg_adapters.separation import (
    Point,
    Space,
    leg,
    may_meet,
    place_of,
    separation_m,
    spot,
)


@dataclass(frozen=True)
class Flyer:
    """A vehicle in the air, or about to be.

    Attributes:
        name: Name of its drone.
        state: Its reported state.
        order: The order that it is carrying out; None if it stays where it is.
        frame: The grid at its altitude.
        mission: Spaces of the mission that it flies, without climb and landing.
    """

    name: str
    state: VehicleState
    order: Order | None
    frame: GridFrame
    mission: Sequence[Space] = ()

    @property
    def place(self) -> Point:
        """Its position."""
        return place_of(self.frame, self.state.lat_deg, self.state.lon_deg)

    @property
    def home(self) -> Point:
        """Where it takes off and lands; its position if it has not reported a home."""
        home = self.state.home
        return self.place if home is None else place_of(self.frame, *home[:2])

    def spaces(self, order: Order | None) -> list[Space]:
        """Return the space that it needs to carry out an order."""
        here, alt_m = self.place, self.state.alt_m
        layer_m = self.frame.alt_m
        match order:
            case TakeOff(alt_m=top_m):
                low_m = alt_m if self.state.flying else 0.0
                return [spot(here, low_m, top_m, home=True)]
            case Search(lat_deg, lon_deg, level_m, search_m):
                there = place_of(self.frame, lat_deg, lon_deg)
                return [
                    spot(here, alt_m, level_m),
                    leg(here, there, level_m),
                    spot(there, search_m, level_m),
                ]
            case GoTo(lat_deg, lon_deg, level_m):
                there = place_of(self.frame, lat_deg, lon_deg)
                return [spot(here, alt_m, level_m), leg(here, there, level_m)]
            case Return():
                return [leg(here, self.home, alt_m), spot(self.home, 0.0, alt_m, home=True)]
            case Land():
                return [spot(here, 0.0, alt_m)]
            case FlyMission():
                climbs = alt_m < layer_m - 1.0
                climb = [spot(self.home, 0.0, layer_m, home=True)] if climbs else []
                return [*climb, *self.mission]
        return [*self.mission] or [spot(here, alt_m, alt_m)]


def admit(order: Order, flyer: Flyer, others: Sequence[Flyer]) -> Order | str:
    """Return the order to give instead of the wanted one, or why that has to wait.

    A vehicle searches without descending above another vehicle that stays there.

    Args:
        order: The wanted order.
        flyer: The vehicle.
        others: The vehicles that fly, or are about to.
    """
    if not flyer.state.has_position:
        return order
    near = [other for other in others if other.state.has_position]
    blocking = _blocking(flyer, flyer.spaces(order), near)
    if blocking is None:
        return order
    if isinstance(order, Search) and blocking.order is None and not blocking.mission:
        level = replace(order, search_alt_m=order.alt_m)
        return admit(level, flyer, others) if level != order else _waits(blocking)
    return _waits(blocking)


def _waits(other: Flyer) -> str:
    return f"waiting for {other.name} to be out of the way"


def _blocking(flyer: Flyer, spaces: Sequence[Space], others: Sequence[Flyer]) -> Flyer | None:
    limit_m = separation_m(flyer.frame)
    for other in others:
        if flyer.frame.alt_m == other.frame.alt_m:
            # The settings put them at one altitude, so layers cannot keep them apart.
            continue
        apart_m = math.dist(flyer.home, other.home)
        if may_meet(spaces, other.spaces(other.order), limit_m, apart_m):
            return other
    return None

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keeps the vehicles of a fleet apart: decides which orders are allowed while others fly.

Each vehicle flies in its own layer. If one leaves its layer, to take off, to search or to come
down, the others stay away from the column below, or it waits for them. A vehicle whose intent is
not known takes the whole column where it is.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsse_ros.flight.orders import FlyMission, FlyTrack, GoTo, Land, Return, SearchPlace, TakeOff
from dsse_ros.flight.vehicle_controller import Order
from dsse_ros.flight.vehicle_state import VehicleState
from dsse_ros.mission_items.separation import (
    Point,
    Space,
    leg,
    meetings,
    place_of,
    places_of,
    rows_of,
    separation_m,
    spot,
)
from dsse_ros.scenario.frames import GridFrame

UNKNOWN_FACTOR = 2.0
"""How much wider than usual the column of a vehicle is whose intent is not known: it may move."""


@dataclass(frozen=True)
class AirborneVehicle:
    """A vehicle in the air, or about to be.

    Attributes:
        name: Name of its drone.
        state: Its reported state, with a position.
        place: That position.
        order: The order that it is carrying out; None if it stays where it is.
        frame: The grid at its altitude above the datum.
        datum_m: Altitude of the datum above mean sea level.
        mission: Spaces of the mission that it flies, without climb and landing.
        known: Whether the bridge knows what it does: not if somebody else has it, or its link is
            lost.
    """

    name: str
    state: VehicleState
    place: Point
    order: Order | None
    frame: GridFrame
    datum_m: float = 0.0
    mission: Sequence[Space] = ()
    known: bool = True

    @property
    def home(self) -> Point:
        """Where it takes off and lands; its position if it has not reported a home."""
        home = self.state.home
        return self.place if home is None else place_of(self.frame, *home[:2])

    @property
    def height_m(self) -> float:
        """Its height above the datum."""
        return self.state.alt_amsl_m - self.datum_m

    @property
    def home_m(self) -> float:
        """Height of its home above the datum."""
        return self.height_m - self.state.alt_m

    def spaces(self, order: Order | None) -> list[Space]:
        """Return the space that it needs to carry out an order, with heights above the datum."""
        here, height_m, layer_m = self.place, self.height_m, self.frame.alt_m
        if not self.known:
            return [spot(here, -math.inf, math.inf)]
        match order:
            case TakeOff(alt_amsl_m=top_amsl_m):
                low_m = height_m if self.state.flying else self.home_m
                return [spot(here, low_m, top_amsl_m - self.datum_m, home=True)]
            case GoTo(lat_deg, lon_deg, level_amsl_m) | SearchPlace(lat_deg, lon_deg, level_amsl_m):
                there = place_of(self.frame, lat_deg, lon_deg)
                level_m = level_amsl_m - self.datum_m
                spaces = [spot(here, height_m, level_m), leg(here, there, level_m)]
                if isinstance(order, SearchPlace):
                    spaces.append(spot(there, order.search_amsl_m - self.datum_m, level_m))
                return spaces
            case FlyTrack(places, beyond, level_amsl_m):
                points = [here, *places_of(self.frame, [*places, beyond])]
                level_m = level_amsl_m - self.datum_m
                legs = [leg(start, end, level_m) for start, end in itertools.pairwise(points)]
                return [spot(here, height_m, level_m), *legs]
            case Return():
                # It may climb first, to the altitude of its parameters.
                top_m = max(height_m, self._return_m)
                way = Space(here, self.home, height_m, top_m)
                return [way, spot(self.home, -math.inf, top_m, home=True)]
            case Land():
                return [spot(here, -math.inf, height_m)]
            case FlyMission():
                climbs = height_m < layer_m - 1.0
                climb = [spot(self.home, self.home_m, layer_m, home=True)] if climbs else []
                return [*climb, *self.mission]
        return [*self.mission] or [spot(here, height_m, height_m)]

    @property
    def _return_m(self) -> float:
        """Height above the datum to which it may climb before it returns; -inf if not known."""
        state = self.state
        heights_m = (self.home_m + state.return_alt_m, self.height_m + state.return_climb_m)
        return max(
            (height_m for height_m in heights_m if math.isfinite(height_m)), default=-math.inf
        )


class Airspace:
    """The vehicles that fly, or are about to.

    Args:
        flyers: By the number of the drone.
    """

    def __init__(self, flyers: Mapping[int, AirborneVehicle]) -> None:
        self._flyers = dict(flyers)
        self._spaces = {i: rows_of(flyer.spaces(flyer.order)) for i, flyer in flyers.items()}
        self._gather()

    def _gather(self) -> None:
        """Gather the spaces of all as rows, with what is asked of the vehicle of each."""
        order = list(self._flyers)
        counts = [len(self._spaces[i]) for i in order]
        flyers = [self._flyers[i] for i in order]
        self._rows = np.concatenate([self._spaces[i] for i in order] or [rows_of(())])
        self._owners = np.repeat(np.array(order, dtype=np.int64), counts)
        self._homes = np.repeat(
            np.array([flyer.home for flyer in flyers]).reshape(-1, 2), counts, 0
        )
        self._layers_m = np.repeat([flyer.frame.alt_m for flyer in flyers], counts)
        self._known = np.repeat(np.array([flyer.known for flyer in flyers], dtype=bool), counts)

    def admit(self, i: int, flyer: AirborneVehicle, order: Order) -> Order | str:
        """Return the order to give instead of the wanted one, or why that has to wait.

        From now on the others keep clear of the returned order. A vehicle searches without
        descending above another vehicle that stays there.

        Args:
            i: Number of the drone.
            flyer: Its vehicle.
            order: The wanted order.
        """
        blocking = self._blocking(i, flyer, order, only_unknown=False)
        if blocking is None:
            self._flyers[i] = replace(flyer, order=order)
            self._spaces[i] = rows_of(flyer.spaces(order))
            self._gather()
            return order
        stays = blocking.known and blocking.order is None and not blocking.mission
        if isinstance(order, SearchPlace) and stays:
            level = replace(order, search_amsl_m=order.alt_amsl_m)
            return self.admit(i, flyer, level) if level != order else _waits(blocking)
        return _waits(blocking)

    def intruder(self, i: int, flyer: AirborneVehicle, order: Order | None) -> str:
        """Return why an order under way has to be interrupted; empty if it goes on.

        Args:
            i: Number of the drone.
            flyer: Its vehicle.
            order: The order.
        """
        blocking = self._blocking(i, flyer, order, only_unknown=True)
        return "" if blocking is None else _waits(blocking)

    def _blocking(
        self, i: int, flyer: AirborneVehicle, order: Order | None, *, only_unknown: bool
    ) -> AirborneVehicle | None:
        chosen = ~self._known
        if not only_unknown:
            # The settings may put two at one altitude, so that layers cannot keep them apart.
            chosen = chosen | (self._layers_m != flyer.frame.alt_m)
        chosen = chosen & (self._owners != i)
        if not chosen.any():
            return None
        owners, known = self._owners[chosen], self._known[chosen]
        limits_m = separation_m(flyer.frame) * np.where(known, 1.0, UNKNOWN_FACTOR)
        homes_m = np.hypot(*(self._homes[chosen] - np.array(flyer.home)).T)
        meet = meetings(rows_of(flyer.spaces(order)), self._rows[chosen], limits_m, homes_m)
        return self._flyers[int(owners[meet][0])] if meet.any() else None


def _waits(other: AirborneVehicle) -> str:
    return f"waiting for {other.name} to be out of the way"

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
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsse_ros.vehicles.control.orders import (
    FlyMission,
    FlyTrack,
    GoTo,
    Hold,
    Land,
    MakeReady,
    Return,
    SearchPlace,
    TakeOff,
)
from dsse_ros.vehicles.control.paced_setpoint import BRAKING_MPS2
from dsse_ros.vehicles.control.vehicle_controller import Order
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.mission_items.separation import (
    SEPARATION_M,
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
from dsse_ros.world.scenario.frames import GridFrame

_OBEYS_S = 0.5
"""Time in which an order reaches a vehicle, and its velocity reaches us."""
_STANDS_MPS = 1.0
"""Speed up to which a vehicle counts as one that stands."""
_PAST_M = 3.0
"""How far past a place a vehicle may fly before it stands there: PX4 does 2.9 m at 10 m/s."""
UNKNOWN_FACTOR = 2.0
"""Factor by which the column of a vehicle is wider if its intent is not known: it may move."""


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
        brakes: Whether it can stop; one that circles flies on.
    """

    name: str
    state: VehicleState
    place: Point
    order: Order | None
    frame: GridFrame
    datum_m: float = 0.0
    mission: Sequence[Space] = ()
    known: bool = True
    brakes: bool = True

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
        if not self.known:
            return [spot(self.place, -math.inf, math.inf)]
        return [*self._spaces(order), *self._braking(order)]

    def _braking(self, order: Order | None) -> list[Space]:
        """Return where it flies on before it obeys an order, if it moves."""
        north_mps, east_mps = self.state.velocity_mps
        speed_mps = math.hypot(north_mps, east_mps)
        if not (self.brakes and speed_mps > _STANDS_MPS):
            return []
        brakes_s = _OBEYS_S + speed_mps / (2.0 * BRAKING_MPS2)
        x_m, y_m = self.place
        end = (x_m + east_mps * brakes_s, y_m + north_mps * brakes_s)
        # Near home it descends as it overshoots.
        near_m = brakes_s * speed_mps + SEPARATION_M
        lands = isinstance(order, Return) and math.dist(self.place, self.home) < near_m
        low_m = -math.inf if lands or isinstance(order, Land) else self.height_m
        return [Space(self.place, end, low_m, self.height_m, home=lands)]

    def _past(self, there: Point) -> Point:
        """Return how far it may fly as it stops at a place; from nearby it is slower."""
        away_m = math.dist(self.place, there)
        if not (self.brakes and away_m > 0.0):
            return there
        share = 1.0 + min(_PAST_M, away_m) / away_m
        (x_m, y_m), (there_x_m, there_y_m) = self.place, there
        return x_m + share * (there_x_m - x_m), y_m + share * (there_y_m - y_m)

    def _spaces(self, order: Order | None) -> list[Space]:
        here, height_m, layer_m = self.place, self.height_m, self.frame.alt_m
        match order:
            case MakeReady() if not self.state.flying:
                # It stays where it stands, whoever is above it.
                return []
            case TakeOff(alt_amsl_m=top_amsl_m):
                low_m = height_m if self.state.flying else self.home_m
                return [spot(here, low_m, top_amsl_m - self.datum_m, home=True)]
            case GoTo(lat_deg, lon_deg, level_amsl_m) | SearchPlace(lat_deg, lon_deg, level_amsl_m):
                there = place_of(self.frame, lat_deg, lon_deg)
                level_m = level_amsl_m - self.datum_m
                way = leg(here, self._past(there), level_m)
                spaces = [spot(here, height_m, level_m), way]
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
        vehicles: The vehicles, by the numbers of their drones.
    """

    def __init__(self, vehicles: Mapping[int, AirborneVehicle]) -> None:
        self._vehicles = dict(vehicles)
        self._spaces = {i: rows_of(one.spaces(one.order)) for i, one in vehicles.items()}
        self._gather()

    def _gather(self) -> None:
        """Gather the spaces of all as rows, with what is asked of the vehicle of each."""
        order = list(self._vehicles)
        counts = [len(self._spaces[i]) for i in order]
        vehicles = [self._vehicles[i] for i in order]
        self._rows = np.concatenate([self._spaces[i] for i in order] or [rows_of(())])
        self._owners = np.repeat(np.array(order, dtype=np.int64), counts)
        self._homes = np.repeat(np.array([one.home for one in vehicles]).reshape(-1, 2), counts, 0)
        self._layers_m = np.repeat([one.frame.alt_m for one in vehicles], counts)
        self._known = np.repeat(np.array([one.known for one in vehicles], dtype=bool), counts)

    def admit(self, i: int, vehicle: AirborneVehicle, order: Order) -> Order | str:
        """Return the order to give instead of the wanted one, or why that has to wait.

        From now on the others keep clear of the returned order. A vehicle searches without
        descending above another vehicle that stays there.

        Args:
            i: Number of the drone.
            vehicle: Its vehicle.
            order: The wanted order.
        """
        blocking = self._blocking(i, vehicle, order, only_unknown=False)
        if blocking is None:
            self._vehicles[i] = replace(vehicle, order=order)
            self._spaces[i] = rows_of(vehicle.spaces(order))
            self._gather()
            return order
        stays = blocking.known and blocking.order is None and not blocking.mission
        if isinstance(order, SearchPlace) and stays:
            level = replace(order, search_amsl_m=order.alt_amsl_m)
            if level != order:
                return self.admit(i, vehicle, level)
        return _waits(vehicle, order, blocking)

    def intruder(self, i: int, vehicle: AirborneVehicle, order: Order | None) -> str | None:
        """Return why an order under way has to be interrupted.

        Args:
            i: Number of the drone.
            vehicle: Its vehicle.
            order: The order.
        """
        blocking = self._blocking(i, vehicle, order, only_unknown=True)
        return None if blocking is None else _waits(vehicle, Hold(), blocking)

    def _blocking(
        self, i: int, vehicle: AirborneVehicle, order: Order | None, *, only_unknown: bool
    ) -> AirborneVehicle | None:
        chosen = ~self._known
        if not only_unknown:
            # The settings may put two at one altitude, so that layers cannot keep them apart.
            chosen = chosen | (self._layers_m != vehicle.frame.alt_m)
        chosen = chosen & (self._owners != i)
        if not chosen.any():
            return None
        owners, known = self._owners[chosen], self._known[chosen]
        limits_m = separation_m(vehicle.frame) * np.where(known, 1.0, UNKNOWN_FACTOR)
        homes_m = np.hypot(*(self._homes[chosen] - np.array(vehicle.home)).T)
        meet = meetings(rows_of(vehicle.spaces(order)), self._rows[chosen], limits_m, homes_m)
        return self._vehicles[int(owners[meet][0])] if meet.any() else None


def is_in_the_way(
    vehicle: AirborneVehicle, orders: Iterable[Order], other: AirborneVehicle, order: Order
) -> bool:
    """Return whether a vehicle, as it carries out orders, is in the way of another one's order."""
    ours = rows_of([space for each in orders for space in vehicle.spaces(each)])
    theirs = rows_of(other.spaces(order))
    limits_m = np.full(len(theirs), separation_m(vehicle.frame))
    homes_m = np.full(len(theirs), math.dist(vehicle.home, other.home))
    return bool(meetings(ours, theirs, limits_m, homes_m).any())


def _waits(vehicle: AirborneVehicle, order: Order, other: AirborneVehicle) -> str:
    """Return what a vehicle waits for; on the ground, from where nobody but a person moves it."""
    waits = f"waiting for {other.name} to be out of the way"
    if not (isinstance(order, TakeOff) and other.order is None and not other.mission):
        return waits
    least_m = separation_m(vehicle.frame) * (1.0 if other.known else UNKNOWN_FACTOR)
    away_m = math.dist(vehicle.place, other.place)
    return (
        f"{waits}: it is {away_m:.0f} m away, {least_m:g} m are kept: move this vehicle, or have "
        f"{other.name} return"
    )

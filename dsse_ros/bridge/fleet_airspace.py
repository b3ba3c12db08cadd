# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the vehicles of a fleet are, and what each may therefore do; looked at once a turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from dsse_ros.bridge.airspace import Airspace, Flyer
from dsse_ros.bridge.flight_plan import FlightPlan, MissionPlan
from dsse_ros.bridge.layer import Layer
from dsse_ros.bridge.vehicle_follower import Permissions, VehicleFollower
from dsse_ros.flight.orders import GoTo
from dsse_ros.flight.vehicle_controller import Order
from dsse_ros.mission_items.separation import Point, places_of

if TYPE_CHECKING:
    from dsse_ros.flight.vehicle import Vehicle


@dataclass
class _Fleet:
    """Numbers of the drones whose vehicles matter to others.

    Attributes:
        flying: In the air.
        avoided: In the air, or about to take off.
        unknown: Of these, those whose intent is not known: somebody else controls them, or their
            link is lost.
        holding_up: To take off, but not ready.
        climbing: On the ground or in the climb.
    """

    flying: set[int] = field(default_factory=set)
    avoided: list[int] = field(default_factory=list)
    unknown: set[int] = field(default_factory=set)
    holding_up: list[int] = field(default_factory=list)
    climbing: list[int] = field(default_factory=list)


class FleetAirspace:
    """What each vehicle may do beside all others.

    Args:
        names: Names of the drones.
        vehicles: Their vehicles.
        followers: Their followers.
        as_mission: Whether the vehicles fly searches as missions.

    Attributes:
        plan: Flight plan of the search; None before the first.
        missions: The missions that they fly, by the number of the drone.
    """

    def __init__(
        self,
        names: Sequence[str],
        vehicles: Sequence[Vehicle],
        followers: Sequence[VehicleFollower],
        *,
        as_mission: bool,
    ) -> None:
        self._names, self._vehicles, self._followers = names, vehicles, followers
        self._as_mission = as_mission
        self.plan: FlightPlan | None = None
        self.missions: Mapping[int, MissionPlan] = {}
        self.look_again()

    def look_again(self) -> None:
        """Forget where the vehicles were."""
        self._airspace: Airspace | None = None
        self._seen: _Fleet | None = None

    def permissions(self, i: int, *, search_alive: bool, commanded: bool) -> Permissions:
        """Return what the other vehicles and the search allow a vehicle to do.

        Args:
            i: Number of the drone.
            search_alive: Whether the search is running.
            commanded: Whether a planner has commanded the drones.
        """
        if self.plan is None:
            return Permissions(search_alive)
        waits = ""
        if self._followers[i].is_awaited:
            planner = "" if commanded or self._as_mission else "the first commands of a planner"
            waits = planner or self._first_to_take_off(i)
        return Permissions(
            search_alive,
            f"waiting for {waits}" if waits else "",
            self._way_home(i),
            partial(self._admit, i),
            partial(self._intruder, i),
        )

    def _first_to_take_off(self, i: int) -> str:
        """Return the vehicle that must take off first, and why; empty for none."""
        fleet, alt_m = self._fleet, self._layer(i).frame.alt_m
        for j in fleet.holding_up:
            if j != i:
                return f"{self._names[j]}: {self._followers[j].blocked or 'not ready'}"
        for j in fleet.climbing if self._as_mission else ():
            # Vehicles in higher layers climb first.
            if self._layer(j).frame.alt_m > alt_m:
                return f"{self._names[j]}, which takes off first"
        return ""

    def _way_home(self, i: int) -> GoTo | None:
        """Return the way home that does not cross the layers of others; None if there is none."""
        others = self._fleet.flying - {i}
        if not others or self._as_mission:
            return None
        return self._layer(i).way_home(self._vehicles[i].state)

    def _admit(self, i: int, order: Order) -> Order | str:
        if not self._vehicles[i].state.has_position:
            return order
        return self._look_around().admit(i, self._flyer(i), order)

    def _intruder(self, i: int, order: Order | None) -> str:
        unknown = self._fleet.unknown - {i}
        if not unknown or not self._vehicles[i].state.has_position:
            return ""
        return self._look_around().intruder(i, self._flyer(i), order)

    def _layer(self, i: int) -> Layer:
        assert self.plan is not None
        return self.plan.layers[i]

    @property
    def _fleet(self) -> _Fleet:
        if self._seen is None:
            self._seen = self._look_at_fleet()
        return self._seen

    def _look_at_fleet(self) -> _Fleet:
        fleet = _Fleet()
        for i, (follower, vehicle) in enumerate(zip(self._followers, self._vehicles, strict=True)):
            state = vehicle.state
            led = follower.custody.airborne or follower.takes_off
            if state.flying:
                fleet.flying.add(i)
            if state.flying or led:
                fleet.avoided.append(i)
                if not (led and state.connected):
                    fleet.unknown.add(i)
            if follower.holds_up:
                fleet.holding_up.append(i)
            # In a mission a vehicle cannot wait on its way up.
            climbs = follower.mission_under_way and not follower.risen
            if climbs or follower.takes_off or follower.is_awaited:
                fleet.climbing.append(i)
        return fleet

    def _look_around(self) -> Airspace:
        """Return the space that the vehicles take."""
        if self._airspace is None:
            drones = [i for i in self._fleet.avoided if self._vehicles[i].state.has_position]
            states = [self._vehicles[i].state for i in drones]
            places = places_of(self._layer(0).frame, [(one.lat_deg, one.lon_deg) for one in states])
            self._airspace = Airspace(
                {i: self._flyer(i, place) for i, place in zip(drones, places, strict=True)}
            )
        return self._airspace

    def _flyer(self, i: int, place: Point | None = None) -> Flyer:
        follower, mission, layer = self._followers[i], self.missions.get(i), self._layer(i)
        flies = mission is not None and (follower.mission_under_way or follower.takes_off)
        spaces = mission.spaces if mission is not None and flies else ()
        state = self._vehicles[i].state
        if place is None:
            (place,) = places_of(layer.frame, [(state.lat_deg, state.lon_deg)])
        return Flyer(
            self._names[i], state, place, follower.given.under_way, layer.frame,
            layer.settings.datum_altitude, spaces, known=i not in self._fleet.unknown,
        )  # fmt: skip

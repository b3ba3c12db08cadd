# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the vehicles of a fleet are, and what each may therefore do; looked at once a turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from dsse_ros.bridge.airspace import Airspace, Flyer
from dsse_ros.bridge.flight_plan import FlightPlan, MissionPlan
from dsse_ros.bridge.vehicle_follower import VehicleFollower
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
    """What each vehicle must know of all others.

    Args:
        names: Names of the drones.
        vehicles: Their vehicles.
        followers: Their followers.
        as_mission: Whether the vehicles fly searches as missions.

    Attributes:
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
        self.missions: Mapping[int, MissionPlan] = {}
        self.look_again()

    def look_again(self) -> None:
        """Forget where the vehicles were."""
        self._airspace: Airspace | None = None
        self._seen: _Fleet | None = None

    def reason_to_wait(self, i: int, plan: FlightPlan) -> str:
        """Return the vehicle that must take off first; empty for none."""
        fleet, alt_m = self._fleet, plan.layers[i].frame.alt_m
        for j in fleet.holding_up:
            if j != i:
                blocked = self._followers[j].blocked or "not ready"
                return f"waiting for {self._names[j]}: {blocked}"
        for j in fleet.climbing if self._as_mission else ():
            # Vehicles in higher layers climb first.
            if plan.layers[j].frame.alt_m > alt_m:
                return f"waiting for {self._names[j]}, which takes off first"
        return ""

    def way_home(self, i: int, plan: FlightPlan) -> GoTo | None:
        """Return the way home that does not cross the layers of others; None if there is none."""
        others = self._fleet.flying - {i}
        if not others or self._as_mission:
            return None
        return plan.layers[i].way_home(self._vehicles[i].state)

    def admit(self, i: int, plan: FlightPlan, order: Order) -> Order | str:
        """Return the order to give instead of the wanted one, or why that has to wait."""
        if not self._vehicles[i].state.has_position:
            return order
        airspace, flyer = self._look_around(plan), self._flyer(i, plan)
        admitted = airspace.admit(i, flyer, order)
        if not isinstance(admitted, str):
            airspace.update(i, replace(flyer, order=admitted))
        return admitted

    def intruder(self, i: int, plan: FlightPlan, order: Order | None) -> str:
        """Return why an order under way has to be interrupted; empty if it goes on."""
        unknown = self._fleet.unknown - {i}
        if not unknown or not self._vehicles[i].state.has_position:
            return ""
        return self._look_around(plan).intruder(i, self._flyer(i, plan), order)

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

    def _look_around(self, plan: FlightPlan) -> Airspace:
        """Return the space that the vehicles take."""
        if self._airspace is None:
            drones = [i for i in self._fleet.avoided if self._vehicles[i].state.has_position]
            states = [self._vehicles[i].state for i in drones]
            places = places_of(plan.layers[0].frame, [(one.lat_deg, one.lon_deg) for one in states])
            self._airspace = Airspace(
                {i: self._flyer(i, plan, place) for i, place in zip(drones, places, strict=True)}
            )
        return self._airspace

    def _flyer(self, i: int, plan: FlightPlan, place: Point | None = None) -> Flyer:
        follower, mission = self._followers[i], self.missions.get(i)
        flies = mission is not None and (follower.mission_under_way or follower.takes_off)
        spaces = mission.spaces if mission is not None and flies else ()
        state, frame = self._vehicles[i].state, plan.layers[i].frame
        if place is None:
            (place,) = places_of(frame, [(state.lat_deg, state.lon_deg)])
        return Flyer(
            self._names[i], state, place, follower.under_way, frame, plan.datum_m, spaces,
            known=i not in self._fleet.unknown,
        )  # fmt: skip

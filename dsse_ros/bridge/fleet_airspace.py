# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the vehicles of a fleet are, and what each may therefore do; looked at once a turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from dsse_ros.bridge.airspace import AirborneVehicle, Airspace
from dsse_ros.bridge.fleet_vehicle import FleetVehicle
from dsse_ros.bridge.flight_plan import FlightPlan, MissionPlan
from dsse_ros.bridge.layer import Layer
from dsse_ros.bridge.vehicle_follower import Permissions
from dsse_ros.flight.orders import GoTo
from dsse_ros.flight.vehicle_controller import Order
from dsse_ros.mission_items.separation import Point, places_of


@dataclass
class _Fleet:
    """Vehicles that matter to others.

    Attributes:
        flying: Numbers of those in the air.
        avoided: In the air, or about to take off.
        unknown: Numbers of those of these whose intent is not known: somebody else controls them,
            or their link is lost.
        climbing: On the ground or in the climb.
    """

    flying: set[int] = field(default_factory=set)
    avoided: list[FleetVehicle] = field(default_factory=list)
    unknown: set[int] = field(default_factory=set)
    climbing: list[FleetVehicle] = field(default_factory=list)


class FleetAirspace:
    """What each vehicle may do beside all others.

    Args:
        members: The vehicles of the fleet.
        as_mission: Whether the vehicles fly searches as missions.

    Attributes:
        plan: Flight plan of the search; None before the first.
        missions: The missions that they fly, by the number of the drone.
    """

    def __init__(self, members: Sequence[FleetVehicle], *, as_mission: bool) -> None:
        self._members = members
        self._as_mission = as_mission
        self.plan: FlightPlan | None = None
        self.missions: Mapping[int, MissionPlan] = {}
        self.look_again()

    def look_again(self) -> None:
        """Forget where the vehicles were."""
        self._airspace: Airspace | None = None
        self._seen: _Fleet | None = None

    def permissions(
        self, member: FleetVehicle, *, search_alive: bool, commanded: bool
    ) -> Permissions:
        """Return what the other vehicles and the search allow a vehicle to do.

        Args:
            member: The vehicle.
            search_alive: Whether the search is running.
            commanded: Whether a planner has commanded the drones.
        """
        if self.plan is None:
            return Permissions(search_alive)
        waits = ""
        if member.follower.is_awaited:
            planner = "" if commanded or self._as_mission else "the first commands of a planner"
            waits = planner or self._first_to_take_off(member)
        return Permissions(
            search_alive,
            f"waiting for {waits}" if waits else "",
            self._way_home(member),
            partial(self._admit, member),
            partial(self._intruder, member),
        )

    def _first_to_take_off(self, member: FleetVehicle) -> str:
        """Return the vehicle that must take off first, and why; empty for none."""
        fleet, alt_m = self._fleet, self._layer(member).frame.alt_m
        for other in self._members:
            if other is not member and other.follower.holds_up:
                return f"{other.name}: {other.follower.blocked or 'not ready'}"
        for other in fleet.climbing if self._as_mission else ():
            # Vehicles in higher layers climb first.
            if self._layer(other).frame.alt_m > alt_m:
                return f"{other.name}, which takes off first"
        return ""

    def _way_home(self, member: FleetVehicle) -> GoTo | None:
        """Return the way home that does not cross the layers of others; None if there is none."""
        others = self._fleet.flying - {member.number}
        if not others or self._as_mission:
            return None
        return self._layer(member).way_home(member.vehicle.state)

    def _admit(self, member: FleetVehicle, order: Order) -> Order | str:
        if not member.vehicle.state.has_position:
            return order
        return self._look_around().admit(member.number, self._flyer(member), order)

    def _intruder(self, member: FleetVehicle, order: Order | None) -> str:
        unknown = self._fleet.unknown - {member.number}
        if not unknown or not member.vehicle.state.has_position:
            return ""
        return self._look_around().intruder(member.number, self._flyer(member), order)

    def _layer(self, member: FleetVehicle) -> Layer:
        assert self.plan is not None
        return self.plan.layers[member.number]

    @property
    def _fleet(self) -> _Fleet:
        if self._seen is None:
            self._seen = self._look_at_fleet()
        return self._seen

    def _look_at_fleet(self) -> _Fleet:
        fleet = _Fleet()
        for member in self._members:
            state, follower = member.vehicle.state, member.follower
            led = follower.custody.airborne or follower.takes_off
            if state.flying:
                fleet.flying.add(member.number)
            if state.flying or led:
                fleet.avoided.append(member)
                if not (led and state.connected):
                    fleet.unknown.add(member.number)
            # In a mission a vehicle cannot wait on its way up.
            climbs = follower.mission_under_way and not follower.risen
            if climbs or follower.takes_off or follower.is_awaited:
                fleet.climbing.append(member)
        return fleet

    def _look_around(self) -> Airspace:
        """Return the space that the vehicles take."""
        if self._airspace is None:
            avoided = [state for state in self._fleet.avoided if state.vehicle.state.has_position]
            states = [state.vehicle.state for state in avoided]
            frame = self._layer(self._members[0]).frame
            places = places_of(frame, [(state.lat_deg, state.lon_deg) for state in states])
            self._airspace = Airspace(
                {
                    member.number: self._flyer(member, place)
                    for member, place in zip(avoided, places, strict=True)
                }
            )
        return self._airspace

    def _flyer(self, member: FleetVehicle, place: Point | None = None) -> AirborneVehicle:
        follower, layer, state = member.follower, self._layer(member), member.vehicle.state
        mission = self.missions.get(member.number)
        flies = mission is not None and (follower.mission_under_way or follower.takes_off)
        spaces = mission.spaces if mission is not None and flies else ()
        if place is None:
            (place,) = places_of(layer.frame, [(state.lat_deg, state.lon_deg)])
        return AirborneVehicle(
            member.name, state, place, follower.given_order.under_way, layer.frame,
            layer.settings.datum_altitude, spaces, known=member.number not in self._fleet.unknown,
        )  # fmt: skip

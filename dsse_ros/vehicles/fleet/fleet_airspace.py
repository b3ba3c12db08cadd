# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What each vehicle of a fleet may do, by where all of them are in this turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from dsse_ros.vehicles.control.orders import GoTo, TakeOff
from dsse_ros.vehicles.control.vehicle_controller import Order
from dsse_ros.vehicles.fleet.airspace import AirborneVehicle, Airspace, is_in_the_way
from dsse_ros.vehicles.fleet.fleet_vehicle import FleetVehicle
from dsse_ros.vehicles.fleet.flight_plan import FlightPlan, MissionPlan
from dsse_ros.vehicles.fleet.layer import Layer
from dsse_ros.vehicles.fleet.vehicle_dispatcher import Permissions
from dsse_ros.vehicles.mission_items.separation import Point, places_of


@dataclass
class _Fleet:
    """Vehicles that matter to others.

    Attributes:
        flying: Numbers of the vehicles in the air.
        avoided: The vehicles in the air, or about to take off.
        unknown: Numbers of those that are avoided and may do anything: somebody else controls them,
            or their link is lost.
        climbing: The vehicles that are about to take off, or have not reached their altitudes.
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
        self.forget_positions()

    def forget_positions(self) -> None:
        """Forget where the vehicles were."""
        # Worked out once a turn, when they are needed.
        self._known_airspace: Airspace | None = None
        self._known_fleet: _Fleet | None = None

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
        waits = None
        if member.dispatcher.is_awaited:
            planner = None if commanded or self._as_mission else "the first commands of a planner"
            waits = planner or self._first_to_take_off(member)
        return Permissions(
            search_alive,
            f"waiting for {waits}" if waits else None,
            self._way_home(member),
            partial(self._admit, member),
            partial(self._intruder, member),
        )

    def _first_to_take_off(self, member: FleetVehicle) -> str | None:
        """Return the vehicle that must take off first, and why."""
        fleet, alt_m = self._fleet, self._layer(member).frame.alt_m
        for other in self._members:
            if other is not member and other.dispatcher.holds_up:
                return f"{other.name}: {other.dispatcher.blocked or 'not ready'}"
        for other in fleet.climbing:
            # Vehicles in higher layers climb first: one that hovers in a lower layer would be in
            # the way of their climbs until the search begins, for which it would wait.
            above = self._layer(other).frame.alt_m > alt_m
            if above and (self._as_mission or self._would_stop(member, other)):
                return f"{other.name}, which takes off first"
        return None

    def _would_stop(self, member: FleetVehicle, other: FleetVehicle) -> bool:
        """Return whether a vehicle in the air could keep another one from taking off."""
        if not (member.vehicle.state.has_position and other.vehicle.state.has_position):
            return False
        custody, task = member.dispatcher.custody, member.dispatcher.progress.task
        orders = (TakeOff(custody.top_amsl_m), *task)
        climb = TakeOff(other.dispatcher.custody.top_amsl_m)
        return is_in_the_way(self._airborne(member), orders, self._airborne(other), climb)

    def _way_home(self, member: FleetVehicle) -> GoTo | None:
        """Return the way home that does not cross the layers of others; None if there is none."""
        others = self._fleet.flying - {member.number}
        if not others or self._as_mission:
            return None
        return self._layer(member).way_home(member.vehicle.state)

    def _admit(self, member: FleetVehicle, order: Order) -> Order | str:
        if not member.vehicle.state.has_position:
            return order
        return self._airspace.admit(member.number, self._airborne(member), order)

    def _intruder(self, member: FleetVehicle, order: Order | None) -> str | None:
        unknown = self._fleet.unknown - {member.number}
        if not unknown or not member.vehicle.state.has_position:
            return None
        return self._airspace.intruder(member.number, self._airborne(member), order)

    def _layer(self, member: FleetVehicle) -> Layer:
        assert self.plan is not None
        return self.plan.layers[member.number]

    @property
    def _fleet(self) -> _Fleet:
        if self._known_fleet is None:
            self._known_fleet = self._sorted_fleet()
        return self._known_fleet

    def _sorted_fleet(self) -> _Fleet:
        fleet = _Fleet()
        for member in self._members:
            state, dispatcher = member.vehicle.state, member.dispatcher
            led = dispatcher.custody.airborne or dispatcher.takes_off
            if state.flying:
                fleet.flying.add(member.number)
            if state.flying or led:
                fleet.avoided.append(member)
                if not (led and state.connected):
                    fleet.unknown.add(member.number)
            # In a mission a vehicle cannot wait on its way up.
            climbs = dispatcher.mission_under_way and not dispatcher.risen
            if climbs or dispatcher.takes_off or dispatcher.is_awaited:
                fleet.climbing.append(member)
        return fleet

    @property
    def _airspace(self) -> Airspace:
        """The space that the vehicles take."""
        if self._known_airspace is None:
            placed = [member for member in self._fleet.avoided if member.vehicle.state.has_position]
            states = [member.vehicle.state for member in placed]
            frame = self._layer(self._members[0]).frame
            places = places_of(frame, [(state.lat_deg, state.lon_deg) for state in states])
            self._known_airspace = Airspace(
                {
                    member.number: self._airborne(member, place)
                    for member, place in zip(placed, places, strict=True)
                }
            )
        return self._known_airspace

    def _airborne(self, member: FleetVehicle, place: Point | None = None) -> AirborneVehicle:
        dispatcher, layer, state = member.dispatcher, self._layer(member), member.vehicle.state
        mission = self.missions.get(member.number)
        flies = mission is not None and (dispatcher.mission_under_way or dispatcher.takes_off)
        spaces = mission.spaces if mission is not None and flies else ()
        if place is None:
            (place,) = places_of(layer.frame, [(state.lat_deg, state.lon_deg)])
        return AirborneVehicle(
            member.name, state, place, dispatcher.given_order.under_way, layer.frame,
            layer.settings.datum_altitude, spaces, known=member.number not in self._fleet.unknown,
            brakes=not layer.autopilot.circles,
        )  # fmt: skip

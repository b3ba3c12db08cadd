# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Makes the vehicles of a fleet follow the drones of a search, without ROS and sockets.

Inputs are messages of searches, calls of operators and the time. Outputs are orders to vehicles,
records and log lines.

On its way to an order a leg passes three decisions: its vehicle's `Layer` has the altitude and the
fence (`leg_task`), its custody the orders that it may get (`MAY_ORDER`), and `FleetAirspace` the
separation from others (`Permissions.admit`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from dsse_ros.base.fields import FieldError
from dsse_ros.base.result import Rejected, Result
from dsse_ros.vehicles.control.orders import FlyTrack
from dsse_ros.vehicles.control.vehicle_controller import Order
from dsse_ros.vehicles.fleet.custody import Custody
from dsse_ros.vehicles.fleet.fleet_airspace import FleetAirspace
from dsse_ros.vehicles.fleet.fleet_vehicle import FleetVehicle
from dsse_ros.vehicles.fleet.fleet_wind import FleetWind, InFlight
from dsse_ros.vehicles.fleet.flight_plan import FlightPlan
from dsse_ros.vehicles.fleet.flight_record import SearchId
from dsse_ros.vehicles.fleet.flight_records import FlightRecords
from dsse_ros.vehicles.fleet.notices import Log, Notices
from dsse_ros.vehicles.fleet.own_return import reason_to_leave
from dsse_ros.vehicles.fleet.search_inbox import News, SearchInbox
from dsse_ros.vehicles.fleet.settings import BridgeSettings
from dsse_ros.vehicles.fleet.vehicle_custody import VehicleCustody
from dsse_ros.vehicles.fleet.vehicle_dispatcher import VehicleDispatcher
from dsse_ros.world.scenario.agents import AgentsInfo

if TYPE_CHECKING:
    from dsse_ros.vehicles.control.vehicle import Vehicle

QUIET_S = 0.5
"""Wall time without a report after which the last one counts: latched reports come in a burst."""
_DRAINED_S = 10.0
"""Wall time after which the last report counts even if more come."""


class FleetController:
    """Follows one search after the other with the same vehicles.

    Args:
        settings: Settings of the bridge.
        vehicles: The vehicles, drone0's first.
        records: Records of who controlled them before; None to keep none.
        log: Takes log lines.

    Attributes:
        names: Names of the drones.
        dispatchers: The dispatcher of each vehicle.
        plan: Flight plan of the search; None before the first.
        search: The followed search, which takes the messages; then call `handle_news`.
        holding: Whether the vehicles hold because no steps come.
    """

    def __init__(
        self,
        settings: BridgeSettings,
        vehicles: Sequence[Vehicle],
        records: FlightRecords | None,
        log: Log,
    ) -> None:
        self._settings = settings
        self._records = records
        self._log = log
        self._as_mission = settings.mode == "mission"
        known = [None if records is None else records[i] for i in range(len(vehicles))]
        self._fleet = [
            FleetVehicle(i, vehicle, VehicleDispatcher(settings, record), log)
            for i, (vehicle, record) in enumerate(zip(vehicles, known, strict=True))
        ]
        self.names = [member.name for member in self._fleet]
        self.dispatchers = [member.dispatcher for member in self._fleet]
        self._airspace = FleetAirspace(self._fleet, as_mission=self._as_mission)
        self.plan: FlightPlan | None = None
        self.search = SearchInbox(len(vehicles), as_mission=self._as_mission, refuse=self._refuse)
        self.holding = False
        self._center = settings.fence_center
        self._first: SearchId | None = None
        self._publishers = 0
        # When the controller started, and the first search began. Drain the latched reports before
        # following one.
        self._now_s = 0.0
        self._start_s: float | None = None
        self._begun_s: float | None = None
        self._drained = False
        self._idle_s: float | None = None
        self._wind = FleetWind()
        self._record_trouble: str | None = None
        self._notices = Notices(log)

    # The search

    def set_publishers(self, count: int) -> bool:
        """Take the number of nodes that publish `step_report`; returns whether it has changed.

        After a change the caller must take the latest `agents` again: those that are not followed
        may be from a simulation that is gone.
        """
        changed = count != self._publishers
        self._publishers = count
        if changed:
            self.search.require_agents()
        return changed

    @property
    def _contested(self) -> str | None:
        if self._publishers < 2:
            return None
        return f"{self._publishers} nodes publish step_report: no other search is followed"

    def _refuse(self, info: AgentsInfo) -> str | None:
        """Return why another search may not be followed."""
        if self._contested:
            return self._contested
        now_s = self._now_s
        self._start_s = now_s if self._start_s is None else self._start_s
        for member in self._fleet:
            custody = member.dispatcher.custody
            heard_s = max(member.vehicle.state.heard_s, self._start_s)
            silent = now_s - heard_s >= self._settings.lost_timeout
            run_id = custody.record.search[0] if custody.record.search else info.run_id
            changed = self.search.info is not None and self.search.info.run_id == info.run_id
            if custody.airborne and not silent and (run_id != info.run_id or changed):
                flies = f"{member.name} is in the air for run {run_id}"
                return f"{flies}: another one waits until it is down"
        return None

    def handle_news(self, now_s: float) -> None:
        """Handle all news of the search."""
        search, self._now_s = self.search, now_s
        while (news := search.next_news(now_s)) is not None:
            assert search.info is not None
            if news is News.BEGUN:
                self._begin(search.info, now_s)
                for member in self._fleet:
                    member.call_off()
            elif news is News.STEP and self._drained:
                self._follow()

    def _begin(self, info: AgentsInfo, now_s: float) -> None:
        """Make the flight plan of a mission, and have the vehicles follow it."""
        self._airspace.missions = {}
        self._begun_s = now_s if self._begun_s is None else self._begun_s
        self._idle_s, self.holding = None, False
        try:
            plan = FlightPlan(self._settings, info, self._center)
        except FieldError as error:
            self.search.fail(f"{error}: nothing is flown")
            for dispatcher in self.dispatchers:
                dispatcher.leave()
            return
        self.plan = self._airspace.plan = plan
        self._center = plan.center
        search = (info.run_id, info.mission)
        self._first = self._first or search
        for i, dispatcher in enumerate(self.dispatchers):
            dispatcher.begin(search, plan.layers[i], first=search == self._first)
        self._log("info", f"mission {info.mission} of run {info.run_id} is followed")

    def _follow(self) -> None:
        """Make the vehicles follow the last step."""
        self._idle_s, self.holding = None, False
        legs = self.search.legs
        if self._as_mission or self.plan is None or not legs:
            return
        for dispatcher, layer, leg in zip(self.dispatchers, self.plan.layers, legs, strict=True):
            dispatcher.follow(leg, layer.leg_task(leg))

    def _plan_missions(self, plan: FlightPlan) -> None:
        """Make the vehicles fly the whole search, once all of them have reported their homes."""
        search = self.search
        going = [member.number for member in self._fleet if not member.dispatcher.lost]
        homes = {i: self._fleet[i].vehicle.state.home for i in going}
        known = {i: home for i, home in homes.items() if home is not None}
        if len(known) == len(going):
            self._airspace.missions = plan.missions({i: search.track(i) for i in going}, known)
        missions = self._airspace.missions
        for i in going:
            task = missions[i].task if i in missions else None
            self.dispatchers[i].follow(search.final_legs[i], task)

    # Operators

    def arm(self, drone: int | None, data: bool) -> tuple[bool, str]:
        """Clear vehicles to fly one search, or keep them on the ground; see `~/arm`.

        Args:
            drone: Number of the drone; None for all.
            data: Whether they may fly.

        Returns:
            Whether at least one vehicle was cleared or kept, and what was done.
        """
        alive = self._search_alive

        def act(custody: VehicleCustody) -> Result[str]:
            if not data:
                return custody.ground()
            return custody.clear(self._now_s, alone=drone is not None, search_alive=alive)

        return self._operate(drone, act)

    def operate(self, drone: int | None, what: str) -> tuple[bool, str]:
        """Make vehicles `hold`, `return` or `land`, whatever the search does.

        Args:
            drone: Number of the drone; None for all.
            what: `hold`, `return` or `land`.

        Returns:
            Whether at least one vehicle does, and what was done.
        """
        return self._operate(drone, lambda custody: custody.operate(what))

    def _operate(
        self, drone: int | None, act: Callable[[VehicleCustody], Result[str]]
    ) -> tuple[bool, str]:
        done: dict[str, list[str]] = {}
        refused = []
        self._airspace.forget_positions()
        for member in self._fleet:
            if drone in (None, member.number):
                result = act(member.dispatcher.custody)
                if isinstance(result, Rejected):
                    refused.append(f"{member.name}: {result.reason}")
                else:
                    done.setdefault(result.value, []).append(member.name)
                self._serve(member, self._now_s)
        text = "; ".join([*(f"{did}: {', '.join(names)}" for did, names in done.items()), *refused])
        self._log("warning", f"operator: {text}")
        return bool(done), text

    # Time

    def turn(self, now_s: float) -> None:
        """Give the vehicles the orders that are due."""
        self._airspace.forget_positions()
        self.handle_news(now_s)
        if self._begun_s is not None and not self._drained:
            quiet = now_s - max(self._begun_s, self.search.report_s) >= QUIET_S
            self._drained = quiet or now_s - self._begun_s >= _DRAINED_S
            if self._drained:
                self._follow()
        if self.search.tracks is not None and self.plan is not None and not self._airspace.missions:
            self._plan_missions(self.plan)
        for member in self._fleet:
            self._serve(member, now_s)
        self._watch_planner(now_s)
        trouble = self.trouble(now_s)
        if trouble:
            self._notices.show("warning", trouble, now_s)

    def take_wind(self, now_s: float) -> tuple[float, float] | None:
        """Return the wind, to the east and to the north, m/s, if the search should plan on it."""
        flown_in, plan = self.search.wind_mps, self.plan
        flying = {}
        for member in self._fleet if flown_in is not None and plan is not None else ():
            assert plan is not None
            dispatcher, state = member.dispatcher, member.vehicle.state
            follows = dispatcher.follows_leg and dispatcher.custody.state is Custody.FOLLOWING
            if follows and dispatcher.risen and state.connected:
                order = dispatcher.given_order.under_way
                flying[member.number] = InFlight(
                    state,
                    order if isinstance(order, FlyTrack) else None,
                    plan.layers[member.number].speed_mps,
                )
        self._wind.update(flying, now_s)
        return None if flown_in is None else self._wind.news(flown_in, now_s)

    def _serve(self, member: FleetVehicle, now_s: float) -> None:
        """Give a vehicle the order that is due, if there is one."""
        before, order = member.dispatcher.custody.state, None
        with member.isolated():
            member.identify(self._records)
        with member.isolated():
            order = self._next_order(member, now_s)
        with member.isolated():
            member.call_off()
        member.dispatcher.leaves_layer = self._leaves_layer(member)
        member.log_news(before, now_s)
        # Record the change before any message shows it, so that a restarted bridge knows it.
        self._keep_record(member)
        if order is not None:
            with member.isolated():
                member.give(order)

    def _next_order(self, member: FleetVehicle, now_s: float) -> Order | None:
        """Return the order that is due for a vehicle."""
        dispatcher, vehicle = member.dispatcher, member.vehicle
        state, outcome, trouble = vehicle.state, vehicle.outcome, vehicle.trouble
        if not (trouble or state.connected):
            trouble = f"nothing from system {vehicle.system_id} on {vehicle.connection}"
        if state.connected and state.identity.uid is None:
            dispatcher.await_identity(state, now_s, trouble)
            return None
        permissions = self._airspace.permissions(
            member, search_alive=self._search_alive, commanded=self.search.commanded
        )
        return dispatcher.advance(state, outcome, now_s, trouble, permissions)

    @property
    def _search_alive(self) -> bool:
        """Whether the followed search is running, and no other one disturbs it."""
        disturbed = self.search.foreign or self._contested
        return self.search.confirmed and not disturbed and self._publishers > 0

    def _keep_record(self, member: FleetVehicle) -> None:
        """Write the record of a vehicle for a restarted bridge."""
        if self._records is None:
            return
        try:
            self._records.update(member.number, member.dispatcher.custody.record)
            self._records.keep_alive()
            self._record_trouble = None
        except OSError as error:
            who = "a restarted bridge would not know who controls the vehicles"
            self._record_trouble = f"state_directory: {error.filename!r}: {error.strerror}; {who}"

    def _watch_planner(self, now_s: float) -> None:
        """Make the vehicles hold if they have waited too long for the next step."""
        timeout_s = self._settings.planner_timeout
        if self._as_mission or timeout_s <= 0 or self.holding:
            return
        going = [dispatcher for dispatcher in self.dispatchers if dispatcher.follows_leg]
        if not going or not all(dispatcher.waiting for dispatcher in going):
            self._idle_s = None
            return
        self._idle_s = now_s if self._idle_s is None else self._idle_s
        if now_s - self._idle_s > timeout_s:
            self.holding = True
            self._log("warning", f"no step within {timeout_s:g} s: the vehicles hold")
            for dispatcher in going:
                dispatcher.progress.holding = True

    def close(self) -> None:
        """Record, as the program ends, that the vehicles are ordered to hold."""
        if not self._as_mission:
            for member in self._fleet:
                member.dispatcher.custody.rest()
                self._keep_record(member)

    # What people should know

    def trouble(self, now_s: float) -> str | None:
        """Return why the vehicles cannot fly the search."""
        return self._contested or self.search.trouble(now_s) or self._record_trouble

    @property
    def finished(self) -> bool:
        """Whether nothing is left to do in the search."""
        return bool(self._fleet) and all(member.dispatcher.finished for member in self._fleet)

    def _leaves_layer(self, member: FleetVehicle) -> str | None:
        """Return why a vehicle that returns by itself would leave its layer."""
        if self.plan is None or len(self._fleet) == 1:
            return None
        return reason_to_leave(member.vehicle.state, self.plan.layers[member.number])

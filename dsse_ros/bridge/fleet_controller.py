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

import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Literal

from dsse_ros.bridge.custody import MAY_ORDER, Custody
from dsse_ros.bridge.fleet_airspace import FleetAirspace
from dsse_ros.bridge.flight_plan import FlightPlan
from dsse_ros.bridge.flight_record import FlightRecord, SearchId
from dsse_ros.bridge.flight_records import FlightRecords
from dsse_ros.bridge.followed_search import FollowedSearch, News
from dsse_ros.bridge.own_return import reason_to_leave
from dsse_ros.bridge.settings import BridgeSettings
from dsse_ros.bridge.vehicle_custody import VehicleCustody
from dsse_ros.bridge.vehicle_follower import VehicleFollower
from dsse_ros.defects import Defects, describe
from dsse_ros.flight.orders import FlyMission, Hold
from dsse_ros.flight.vehicle_controller import Order
from dsse_ros.result import Rejected, Result
from dsse_ros.scenario.agents import AgentsInfo
from dsse_ros.scenario.fields import FieldError

if TYPE_CHECKING:
    from dsse_ros.flight.vehicle import Vehicle

Level = Literal["debug", "info", "warning", "error"]
QUIET_S = 0.5
"""Wall time without a report after which the last one counts: latched reports come in a burst."""
_DRAINED_S = 10.0
"""Wall time after which the last report counts even if more come."""
_NEWS: tuple[tuple[Level, str], ...] = (
    ("error", " is lost"), ("warning", ""), ("info", " waits"), ("warning", "")
)  # fmt: skip
"""How news of a vehicle are logged: why it is lost, refused, blocked, and where it returns."""
_NOT_ENDED = ("under_way", "silent", "done", "failed")

Log = Callable[[Level, str], None]


class FleetController:
    """Follows one search after the other with the same vehicles.

    Args:
        settings: Settings of the bridge.
        vehicles: The vehicles, drone0's first.
        records: Records of who controlled them before; None to keep none.
        log: Takes log lines.

    Attributes:
        names: Names of the drones.
        followers: One for each vehicle.
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
        self._vehicles = vehicles
        self._records = records
        self._log = log
        self._as_mission = settings.mode == "mission"
        self.names = [f"drone{i}" for i in range(len(vehicles))]
        self.followers = [
            VehicleFollower(settings, None if records is None else records[i])
            for i in range(len(vehicles))
        ]
        # The id with which each vehicle has been identified.
        self._uids: list[str | None] = [None] * len(vehicles)
        self._airspace = FleetAirspace(
            self.names, vehicles, self.followers, as_mission=self._as_mission
        )
        for i in range(len(vehicles)):
            self._adopt(i)
        self.plan: FlightPlan | None = None
        self.search = FollowedSearch(
            len(vehicles), as_mission=self._as_mission, refuse=self._refuse
        )
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
        self._record_trouble = ""
        self._defects = [Defects() for _ in self.names]
        # For each vehicle, the last logged reasons: see `_NEWS`.
        self._logged = [("",) * len(_NEWS)] * len(vehicles)
        for name, follower, _ in self._each():
            if follower.custody.state is not Custody.FREE:
                log("warning", f"{name}: {_shown(follower)}, from an earlier flight")

    def _adopt(self, i: int) -> None:
        """Count the modes that an earlier program has set as those of the bridge."""
        record, vehicle = self.followers[i].custody.record, self._vehicles[i]
        for mode in filter(None, (record.mode, *record.ordered)):
            vehicle.adopt(mode)

    def _each(self) -> list[tuple[str, VehicleFollower, Vehicle]]:
        return list(zip(self.names, self.followers, self._vehicles, strict=True))

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
    def _contested(self) -> str:
        if self._publishers < 2:
            return ""
        return f"{self._publishers} nodes publish step_report: no other search is followed"

    def _refuse(self, info: AgentsInfo) -> str:
        """Return why another search may not be followed; empty if it may."""
        if self._contested:
            return self._contested
        now_s = self._now_s
        self._start_s = now_s if self._start_s is None else self._start_s
        for name, follower, vehicle in self._each():
            custody, heard_s = follower.custody, max(vehicle.state.heard_s, self._start_s)
            silent = now_s - heard_s >= self._settings.lost_timeout
            run_id = custody.record.search[0] if custody.record.search else info.run_id
            changed = self.search.info is not None and self.search.info.run_id == info.run_id
            if custody.airborne and not silent and (run_id != info.run_id or changed):
                return f"{name} is in the air for run {run_id}: another one waits until it is down"
        return ""

    def handle_news(self, now_s: float) -> None:
        """Handle all news of the search."""
        search, self._now_s = self.search, now_s
        while (news := search.next_news(now_s)) is not None:
            assert search.info is not None
            if news is News.BEGUN:
                self._begin(search.info, now_s)
                for _, follower, vehicle in self._each():
                    self._call_off(follower, vehicle)
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
            if self.search.fail(f"{error}: nothing is flown"):
                self._log("error", f"{error}: nothing is flown")
            for follower in self.followers:
                follower.leave()
            return
        self.plan = self._airspace.plan = plan
        self._center = plan.center
        search = (info.run_id, info.mission)
        self._first = self._first or search
        for i, follower in enumerate(self.followers):
            follower.begin(search, plan.layers[i], first=search == self._first)
        self._log("info", f"mission {info.mission} of run {info.run_id} is followed")

    def _follow(self) -> None:
        """Make the vehicles follow the last step."""
        self._idle_s, self.holding = None, False
        legs = self.search.legs
        if self._as_mission or self.plan is None or not legs:
            return
        for follower, layer, leg in zip(self.followers, self.plan.layers, legs, strict=True):
            follower.follow(leg, layer.leg_task(leg))

    def _plan_missions(self, plan: FlightPlan) -> None:
        """Make the vehicles fly the whole search, once all of them have reported their homes."""
        search = self.search
        homes = {i: one.state.home for i, one in enumerate(self._vehicles)}
        going = [i for i, follower in enumerate(self.followers) if not follower.lost]
        known = {i: home for i in going if (home := homes[i]) is not None}
        if len(known) == len(going):
            self._airspace.missions = plan.missions({i: search.track(i) for i in going}, known)
        missions = self._airspace.missions
        for i in going:
            task = missions[i].task if i in missions else None
            self.followers[i].follow(search.final_legs[i], task)

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
        self._airspace.look_again()
        for i, (name, follower, _) in enumerate(self._each()):
            if drone in (None, i):
                result = act(follower.custody)
                if isinstance(result, Rejected):
                    refused.append(f"{name}: {result.reason}")
                else:
                    done.setdefault(result.value, []).append(name)
                self._serve(i, self._now_s)
        text = "; ".join([*(f"{did}: {', '.join(names)}" for did, names in done.items()), *refused])
        self._log("warning", f"operator: {text}")
        return bool(done), text

    def _call_off(self, follower: VehicleFollower, vehicle: Vehicle) -> None:
        """Cancel an order that is no longer allowed."""
        custody, outcome = follower.custody.state, vehicle.outcome
        # A completed order may continue as a stream of setpoints, except on the ground.
        ends = ("under_way", "silent") if custody is Custody.GROUNDED else _NOT_ENDED
        # Without a link the vehicle cannot get the next order, and would first go on with this one.
        void = not MAY_ORDER[custody] or (
            outcome.order != follower.given.order and not vehicle.state.connected
        )
        leaves = isinstance(outcome.order, Hold) and outcome.status in ("under_way", "silent")
        if void and not leaves and outcome.order is not None and outcome.status in ends:
            vehicle.release()

    # Time

    def turn(self, now_s: float) -> None:
        """Give the vehicles the orders that are due."""
        self._airspace.look_again()
        self.handle_news(now_s)
        if self._begun_s is not None and not self._drained:
            quiet = now_s - max(self._begun_s, self.search.report_s) >= QUIET_S
            self._drained = quiet or now_s - self._begun_s >= _DRAINED_S
            if self._drained:
                self._follow()
        if self.search.tracks is not None and self.plan is not None and not self._airspace.missions:
            self._plan_missions(self.plan)
        for i in range(len(self.followers)):
            self._serve(i, now_s)
        self._watch_planner(now_s)

    def _serve(self, i: int, now_s: float) -> None:
        """Give a vehicle the order that is due, if there is one."""
        follower, vehicle = self.followers[i], self._vehicles[i]
        before, order = follower.custody.state, None
        with self._isolated(i):
            self._identify(i)
        with self._isolated(i):
            order = self._next_order(i, now_s)
        with self._isolated(i):
            self._call_off(follower, vehicle)
        follower.leaves_layer = self._leaves_layer(i)
        self._log_news(i, before)
        # Record the change before any message shows it, so that a restarted bridge knows it.
        self._keep_record(i)
        if order is not None:
            with self._isolated(i):
                number = vehicle.give(order, follower.custody.authority)
                self._log("info", f"{self.names[i]}: order {number}: {shown_order(order)}")

    def _identify(self, i: int) -> None:
        """Recognise that another vehicle is connected than the one whose record is known."""
        state, follower = self._vehicles[i].state, self.followers[i]
        uid = state.identity.uid
        if uid is None or uid == self._uids[i]:
            return
        first, self._uids[i] = self._uids[i] is None, uid
        known = follower.custody.record
        record = FlightRecord() if self._records is None else self._records.identify(i, uid)
        if record != known and not (first and self._records is None):
            self._log("warning", f"{self.names[i]}: another vehicle is connected")
            follower.replace_vehicle(record)
            self._adopt(i)

    @contextmanager
    def _isolated(self, i: int) -> Iterator[None]:
        """Act for one vehicle; if that raises, only that vehicle drops out."""
        try:
            yield
        except Exception as error:
            why = f"defect: {describe(error)}"
            if self._defects[i].is_new(error):
                self._log("error", f"{self.names[i]}: {why}")
                self._log("debug", traceback.format_exc())
            self.followers[i].custody.drop_out(why)

    def _next_order(self, i: int, now_s: float) -> Order | None:
        """Return the order that is due for a vehicle."""
        follower, vehicle = self.followers[i], self._vehicles[i]
        state, outcome, trouble = vehicle.state, vehicle.outcome, vehicle.trouble
        if not (trouble or state.connected):
            trouble = f"nothing from system {vehicle.system_id} on {vehicle.connection}"
        if state.connected and state.identity.uid is None:
            follower.await_identity(state, now_s, trouble)
            return None
        permissions = self._airspace.permissions(
            i, search_alive=self._search_alive, commanded=self.search.commanded
        )
        return follower.advance(state, outcome, now_s, trouble, permissions)

    @property
    def _search_alive(self) -> bool:
        """Whether the followed search is running, and no other one disturbs it."""
        disturbed = self.search.foreign or self._contested
        return self.search.confirmed and not disturbed and self._publishers > 0

    def _keep_record(self, i: int) -> None:
        """Write the record of a vehicle for a restarted bridge."""
        if self._records is None:
            return
        try:
            self._records.update(i, self.followers[i].custody.record)
            self._records.keep_alive()
            self._record_trouble = ""
        except OSError as error:
            trouble = f"state_directory: {error.filename!r}: {error.strerror}"
            if trouble != self._record_trouble:
                self._record_trouble = trouble
                who = "a restarted bridge would not know who controls the vehicles"
                self._log("warning", f"{trouble}; {who}")

    def _watch_planner(self, now_s: float) -> None:
        """Make the vehicles hold if they have waited too long for the next step."""
        timeout_s = self._settings.planner_timeout
        if self._as_mission or timeout_s <= 0 or self.holding:
            return
        going = [follower for follower in self.followers if follower.follows_leg]
        if not going or not all(follower.waiting for follower in going):
            self._idle_s = None
            return
        self._idle_s = now_s if self._idle_s is None else self._idle_s
        if now_s - self._idle_s > timeout_s:
            self.holding = True
            self._log("warning", f"no step within {timeout_s:g} s: the vehicles hold")
            for follower in going:
                follower.progress.holding = True

    def close(self) -> None:
        """Record, as the program ends, that the vehicles are ordered to hold."""
        if not self._as_mission:
            for i, follower in enumerate(self.followers):
                follower.custody.rest()
                self._keep_record(i)

    # What people should know

    def trouble(self, now_s: float) -> str:
        """Return why the vehicles cannot fly the search; empty if they can."""
        return self._contested or self.search.trouble(now_s) or self._record_trouble

    @property
    def finished(self) -> bool:
        """Whether nothing is left to do in the search."""
        return bool(self.followers) and all(follower.finished for follower in self.followers)

    def _leaves_layer(self, i: int) -> str:
        """Return why a vehicle that returns by itself would leave its layer; empty if it stays."""
        if self.plan is None or len(self._vehicles) == 1:
            return ""
        return reason_to_leave(self._vehicles[i].state, self.plan.layers[i])

    def _log_news(self, i: int, before: Custody) -> None:
        name, follower = self.names[i], self.followers[i]
        if follower.custody.state is not before:
            self._log("info", f"{name}: {before.value} -> {_shown(follower)}")
        reasons = (follower.lost, follower.refused, follower.blocked, follower.leaves_layer)
        for (level, what), reason, logged in zip(_NEWS, reasons, self._logged[i], strict=True):
            if reason and reason != logged:
                self._log(level, f"{name}{what}: {reason}")
        self._logged[i] = reasons
        for text in self._vehicles[i].take_texts():
            self._log("info", f"{name}: STATUSTEXT {text.text}")


def _shown(follower: VehicleFollower) -> str:
    record = follower.custody.record
    if record.lost and record.custody in (Custody.TAKEN, Custody.FAILSAFE):
        return record.lost  # such as "taken over: in LOITER"
    return f"{record.custody.value}: {record.lost}" if record.lost else record.custody.value


def shown_order(order: Order | None) -> str:
    """Return an order as one line, with the number of items for a mission."""
    if order is None:
        return ""
    return (
        f"FlyMission of {len(order.items)} items" if isinstance(order, FlyMission) else repr(order)
    )

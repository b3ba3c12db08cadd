# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Chooses the next order of a drone's vehicle, without ROS, links and clocks.

`VehicleCustody` decides who controls the vehicle and which orders are allowed; this module decides
which order is wanted.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import cast

from dsse_ros.autopilots import AUTOPILOTS
from dsse_ros.bridge.custody import ENDS, MAY_ORDER, Custody, Event
from dsse_ros.bridge.flight_record import FlightRecord, SearchId
from dsse_ros.bridge.foreign_acts import RISEN_M
from dsse_ros.bridge.layer import Layer, Task
from dsse_ros.bridge.place_watch import Low, PlaceWatch, waits_over_home
from dsse_ros.bridge.progress import GivenOrder, LegProgress
from dsse_ros.bridge.settings import BridgeSettings
from dsse_ros.bridge.take_off import lacks, reason_to_stay, unready
from dsse_ros.bridge.vehicle_custody import Arm, VehicleCustody
from dsse_ros.flight.orders import (
    FlyMission,
    GoTo,
    Hold,
    Land,
    MakeReady,
    Return,
    SearchPlace,
    TakeOff,
)
from dsse_ros.flight.vehicle_controller import Order, Outcome
from dsse_ros.flight.vehicle_state import VehicleState
from dsse_ros.mission_items.track_missions import VehicleLeg
from dsse_ros.result import Result


@dataclass(frozen=True)
class Permissions:
    """Permissions of a vehicle, from the other vehicles and the search.

    Attributes:
        search_alive: Whether the search is running; without it no vehicle takes off.
        take_off: Why the vehicle must not take off yet; empty if it may.
        home: Place to fly to, at its altitude, before it comes down there; None to come down at
            once.
        admit: Returns the order to give instead of the wanted one, or why that has to wait.
        intruder: Returns why an order under way has to be interrupted; empty if it goes on.
    """

    search_alive: bool = True
    take_off: str = ""
    home: GoTo | None = None
    admit: Callable[[Order], Order | str] = lambda order: order
    intruder: Callable[[Order | None], str] = lambda order: ""


class VehicleFollower:
    """Makes one vehicle follow its drone along its legs, one order at a time.

    Args:
        settings: Settings of the bridge.
        record: Its record so far.

    Attributes:
        custody: Who controls it.
        progress: How far it is with the current leg.
        given_order: Its last order.
        no_take_off: Why it must not take off from where it stands; empty if it may.
        blocked: What keeps it from doing what it should; empty if nothing does.
        ready: Whether it could take off now if the other vehicles allow it.
        risen: Whether it has been at its altitude in this search.
        finished: Whether it has nothing left to do in this search.
        leaves_layer: Why it would leave its layer to return by itself; empty if it would not.
    """

    def __init__(self, settings: BridgeSettings, record: FlightRecord | None = None) -> None:
        self._settings = settings
        self._autopilot = AUTOPILOTS[settings.autopilot]
        self._as_mission = settings.mode == "mission"
        self._place_watch = PlaceWatch(self._autopilot.circle_m)
        self._layer: Layer | None = None
        self.leaves_layer = ""
        self._forget_search()
        self.custody = VehicleCustody(
            self._autopilot,
            cast(Arm, settings.arm),
            record or FlightRecord(),
            self._forget_order,
            as_mission=self._as_mission,
        )

    def _forget_search(self) -> None:
        self.progress = LegProgress()
        self.no_take_off = ""
        self.blocked = ""
        self.ready = False
        self.risen = False
        self.finished = False
        self._blocked_since_s = math.inf
        self._forget_order()

    def _forget_order(self) -> None:
        self.given_order = GivenOrder()

    # The search

    def begin(self, search: SearchId, layer: Layer, *, first: bool = False) -> None:
        """Follow a search.

        Args:
            search: The search.
            layer: Where the vehicle flies.
            first: Whether it is the first search of this program, for which the parameter `arm`
                may clear the vehicle.
        """
        self._forget_search()
        self._layer = layer
        self.custody.begin(search, layer.top_amsl_m, first=first)

    def leave(self) -> None:
        """Follow no search: a search that cannot be flown is over."""
        self._forget_search()
        self.custody.leave()

    def follow(self, leg: VehicleLeg, task: Result[Task] | None) -> None:
        """Replace the leg and its task.

        Args:
            leg: The leg.
            task: The task, or why the vehicle may not do it; None if it is not known yet.
        """
        self.progress.follow(leg, task, self.custody.record.looked)

    def replace_vehicle(self, record: FlightRecord) -> None:
        """Follow with another vehicle that has turned out to be connected.

        Args:
            record: That vehicle's record.
        """
        self._forget_order()
        self.risen = self.progress.arrived = False
        self.custody.replace_vehicle(record)

    @property
    def refused(self) -> str:
        """Why the task, or the take-off, is refused; empty if it is not."""
        return f"take-off: {self.no_take_off}" if self.no_take_off else self.progress.refused

    @property
    def lost(self) -> str:
        """Why the vehicle no longer follows its drone; empty if it does."""
        return self.custody.lost

    @property
    def looked_number(self) -> int:
        """Number of the leg if the vehicle has looked for it; else -1."""
        return self.progress.number if self.progress.looked else -1

    @property
    def arrived_number(self) -> int:
        """Number of the leg if the vehicle has done all of it; else -1."""
        return self.progress.number if self.progress.arrived else -1

    @property
    def waiting(self) -> bool:
        """Whether it has nothing to do until the next step."""
        return not self.follows_leg or self.progress.arrived or bool(self.refused)

    @property
    def follows_leg(self) -> bool:
        """Whether it follows its drone in a search that goes on."""
        leg = self.progress.leg
        return leg is not None and not (leg.over or self.lost)

    @property
    def mission_under_way(self) -> bool:
        """Whether it flies its search as a mission."""
        return (
            self._as_mission
            and self.custody.state is Custody.FOLLOWING
            and not self.progress.arrived
        )

    @property
    def holds_up(self) -> bool:
        """Whether it still has to take off, but cannot now."""
        return self.is_awaited and not self.ready

    @property
    def takes_off(self) -> bool:
        """Whether it was ordered to take off, and is on the ground."""
        ordered = isinstance(self.given_order.order, TakeOff | FlyMission)
        return ordered and self.custody.state is Custody.CLEARED

    @property
    def is_awaited(self) -> bool:
        """Whether it should take off for the followed search."""
        custody = self.custody
        return self.progress.leg is not None and not custody.airborne and not custody.is_out

    # Time

    def advance(
        self,
        state: VehicleState,
        outcome: Outcome,
        now_s: float,
        trouble: str = "",
        permissions: Permissions | None = None,
    ) -> Order | None:
        """Return the order to give now, None if there is no new one.

        Args:
            state: State that the vehicle reports.
            outcome: Outcome of the last order.
            now_s: Time on a steady clock, the one of `state.heard_s`.
            trouble: What is wrong with its link; empty if nothing is.
            permissions: What the other vehicles and the search allow it to do.
        """
        permissions = permissions or Permissions()
        self._look(outcome, now_s)
        self._set_over()
        self.custody.observe(state, outcome, now_s)
        self.custody.lapse(now_s)
        self._watch(state, now_s, trouble)
        self.custody.clear_automatically(now_s)
        self._await_take_off(state, outcome, now_s, trouble, permissions)
        self.finished = self._is_finished(state)
        return self._next_order(state, now_s, permissions) if state.connected else None

    def await_identity(self, state: VehicleState, now_s: float, trouble: str) -> None:
        """Let time pass while it is not known which vehicle is connected."""
        self._await_take_off(state, Outcome(), now_s, trouble, Permissions())

    def _look(self, outcome: Outcome, now_s: float) -> None:
        """Handle the outcome of the order."""
        last, due = self.given_order, self.progress.due
        fails = last.look(outcome, now_s)
        if last.done and due is not None and last.wanted == self._stamped(due):
            if isinstance(due, SearchPlace):
                self.custody.look_done(self.progress.number)
            self.progress.advance()
        if fails and not self.lost:
            self.custody.drop_out(f"failed: {outcome.reason}")

    def _set_over(self) -> None:
        """Recognise whether this vehicle has nothing left to do in the search."""
        custody, progress, leg = self.custody, self.progress, self.progress.leg
        if leg is None or not leg.over:
            custody.over = False
        elif self._as_mission:
            record = custody.record
            landed = record.flown and record.search == custody.search and not custody.airborne
            # It stays over if it is then cleared for another search.
            custody.over |= progress.arrived or landed
        else:
            done = progress.arrived or progress.late or leg.crashed
            nothing_left = done or not progress.task
            custody.over = nothing_left or custody.state is not Custody.FOLLOWING

    def _watch(self, state: VehicleState, now_s: float, trouble: str) -> None:
        """Recognise whether the vehicle cannot follow its drone any further, or need not."""
        custody = self.custody
        self.risen |= state.has_position and state.alt_amsl_m > custody.top_amsl_m - RISEN_M
        if self.mission_under_way and waits_over_home(self.progress.due, state, self._autopilot):
            self.progress.arrived = custody.over = True
        if custody.over and custody.record.search == custody.search:
            custody.on(Event.SEARCH_OVER)
        if not (custody.airborne or custody.state is Custody.CLEARED):
            return
        if state.connected and state.flying and state.has_position:
            self._watch_place(state, now_s)
        elif not state.flying:
            self._place_watch = PlaceWatch(self._autopilot.circle_m)
        because = f": {trouble}" if trouble else ""
        silent = bool(state.mode) and not state.connected
        if state.unfit:
            custody.drop_out(state.unfit)
        elif silent and now_s - state.heard_s >= self._settings.lost_timeout and not self.lost:
            timeout_s = self._settings.lost_timeout
            custody.drop_out(f"link lost: no heartbeat for {timeout_s:g} s{because}")

    def _watch_place(self, state: VehicleState, now_s: float) -> None:
        """Recognise whether it has left its place, the fence or the air without an order."""
        custody, layer, watch = self.custody, self._layer, self._place_watch
        progress, task = self.progress, self.progress.due
        stays = progress.arrived and custody.state is Custody.FOLLOWING
        if watch.has_left(task if stays and isinstance(task, GoTo) else None, state, now_s):
            # It is ordered there again.
            progress.arrived, self.given_order.wanted = False, None
        if layer is None or not custody.airborne:
            return
        if watch.falls(state, now_s, layer.fence, self._low_reason(state)):
            custody.fall(f"fell to {state.alt_m:.0f} m above home without an order")
            progress.arrived = False
        elif not self._as_mission:
            # A mission goes on without the bridge, and all of it is checked before.
            outside = watch.outside(state, now_s, layer.fence)
            if outside and custody.state is Custody.FOLLOWING:
                custody.drop_out(f"outside the fence: {outside}")

    def _low_reason(self, state: VehicleState) -> Low:
        """Return why it may be below the lowest altitude."""
        custody = self.custody
        ordered = custody.state is Custody.RECALLED or isinstance(
            self.given_order.order, Return | Land
        )
        if self._as_mission:
            # The last item brings it down.
            last = custody.record.items - 1 + self._autopilot.first_item
            ordered |= not custody.record.items or state.item_current >= last
        if ordered or state.mode in self._autopilot.descent_modes:
            return Low.ORDERED
        climbs = isinstance(self.given_order.under_way, TakeOff)
        return Low.CLIMBING if climbs else Low.RISEN if self.risen else Low.UNKNOWN

    def _is_finished(self, state: VehicleState) -> bool:
        if self.progress.leg is None:
            return False
        if self.custody.airborne and state.connected:
            at_rest = (
                self.given_order.done and self.given_order.order == ENDS[self._settings.at_end]
            )
            return self.custody.state is Custody.ENDING and at_rest
        return self.custody.is_out

    # Before the take-off

    def _await_take_off(
        self,
        state: VehicleState,
        outcome: Outcome,
        now_s: float,
        trouble: str,
        permissions: Permissions,
    ) -> None:
        """Recognise what keeps it from taking off; drop out if that takes too long."""
        self.ready = False
        if not self.is_awaited:
            self.blocked, self.no_take_off, self._blocked_since_s = "", "", math.inf
            return
        because = f": {trouble}" if trouble else ""
        what, why = self._reason_not_to_fly(state, outcome, because)
        self.blocked = what + why
        if what:
            self._blocked_since_s = min(self._blocked_since_s, now_s)
            if now_s - self._blocked_since_s > self._settings.join_timeout:
                self.custody.drop_out(f"{what} within {self._settings.join_timeout:g} s{why}")
            return
        self._blocked_since_s = math.inf
        self.ready = self.custody.state is Custody.CLEARED
        if not self.ready:
            # Waiting for a person has no timeout.
            in_the_air = state.flying or state.armed
            # In the air it is cleared alone.
            alone = self.custody.state is Custody.RELEASED and in_the_air and not self._as_mission
            clears = "drone<i>/arm clears it to fly" if alone else "~/arm clears it to fly"
            self.blocked = f"{self.custody.holder}: {clears}"
        elif permissions.take_off:
            self.blocked = permissions.take_off

    def _reason_not_to_fly(
        self, state: VehicleState, outcome: Outcome, because: str
    ) -> tuple[str, str]:
        """Return what keeps it from taking off, and why; empty if only a person does."""
        lacking = lacks(state, because)
        if lacking[0] or not state.connected:
            return lacking
        because = because or unready(state)
        if self._as_mission and not self.progress.has_task:
            return "no home position", because
        if self.custody.state is not Custody.CLEARED or state.armed:
            return "", ""
        assert self._layer is not None
        self.no_take_off = reason_to_stay(state, self._layer)
        if self.no_take_off:
            return "no take-off", f": {self.no_take_off}"
        # Readiness may depend on the mode, which `MakeReady` sets.
        prepared = not isinstance(self.given_order.under_way, MakeReady)
        if not (state.ready and prepared):
            waits = self.given_order.order is not None and outcome.reason
            return "not ready", f": {outcome.reason}" if waits else because
        return "", ""

    # Orders

    def _next_order(
        self, state: VehicleState, now_s: float, permissions: Permissions
    ) -> Order | None:
        """Return the order to give now, if custody allows it, and the other vehicles do."""
        wanted = self._wanted(state, permissions)
        if wanted is None or not isinstance(wanted, MAY_ORDER[self.custody.state]):
            return None
        last, stamped, intruder = self.given_order, self._stamped(wanted), ""
        # A vehicle that has dropped out, or was recalled, does not wait for others.
        waits = not self.lost and self.custody.state is not Custody.RECALLED
        if stamped == last.wanted:
            if waits and self._may_stop and not last.done:
                intruder = permissions.intruder(last.order)
            if not (intruder or last.is_due_again(now_s)):
                return None
        admitted: Order | str = wanted
        if intruder:
            admitted, stamped, self.blocked = Hold(), (Hold(), 0), intruder
        elif waits:
            admitted = permissions.admit(wanted)
        if isinstance(admitted, str):
            self.blocked = admitted
            return None
        last.give(admitted, stamped)
        self.custody.record_order(admitted)
        return admitted

    @property
    def _may_stop(self) -> bool:
        """Whether it may be ordered to hold where it is; one that circles would stay near."""
        hovers = not (self._as_mission or self._autopilot.circles)
        return hovers and Hold in MAY_ORDER[self.custody.state]

    def _stamped(self, order: Order) -> tuple[Order, int]:
        return order, self.progress.number if isinstance(order, SearchPlace) else 0

    def _wanted(self, state: VehicleState, permissions: Permissions) -> Order | None:
        """Return what the vehicle should be doing, None where no order is needed."""
        match self.custody.state:
            case Custody.CLEARED:
                return self._wanted_on_the_ground(state, permissions)
            case Custody.FOLLOWING:
                return self._wanted_in_the_air(state)
            case Custody.HELD:
                return Hold()
            case Custody.RECALLED:
                record = self.custody.record
                from_mode = record.from_modes[0] if record.from_modes else ""
                return Land(from_mode) if record.end == "land" else Return(from_mode)
            case Custody.ENDING:
                return self._wanted_at_the_end(state, permissions)
        return None

    def _wanted_on_the_ground(self, state: VehicleState, permissions: Permissions) -> Order | None:
        if not self.is_awaited or not state.has_position:
            return None
        arm, modes = self.custody.record.arm, self.custody.record.from_modes
        refused = bool(self.refused) or not permissions.search_alive
        if refused or permissions.take_off or not (self.ready or self.takes_off):
            # This also cancels a take-off that has not begun.
            return MakeReady(arm, modes)
        if not self._as_mission:
            return TakeOff(self.custody.top_amsl_m, arm, modes)
        mission = self.progress.due
        if isinstance(mission, FlyMission):
            return replace(mission, arm=arm, from_modes=modes)
        return None

    def _wanted_in_the_air(self, state: VehicleState) -> Order | None:
        custody, progress = self.custody, self.progress
        if self._as_mission or progress.leg is None or custody.record.search != custody.search:
            # A mission ends by itself, and goes on without the bridge.
            return None
        climb = self.given_order.under_way
        if isinstance(climb, TakeOff):
            # An order to fly somewhere would end the climb.
            return climb
        if not state.flying or self._place_watch.is_outside:
            return None
        return Hold() if progress.holding else progress.due or Hold()

    def _wanted_at_the_end(self, state: VehicleState, permissions: Permissions) -> Order | None:
        end, home = ENDS["return" if self._as_mission else self._settings.at_end], permissions.home
        # An earlier program may have begun the end.
        begun = self.given_order.was_given_for(end) or state.mode in self._autopilot.descent_modes
        there = home is not None and self.given_order.done and self.given_order.was_given_for(home)
        return end if home is None or end == Hold() or self.lost or begun or there else home

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Chooses the next order of a drone's vehicle, without ROS, links and clocks.

Each turn has four steps (`VehicleDispatcher.advance`): what is seen, the events in it, the order
that is wanted, and the order that is admitted. `VehicleCustody` decides who controls the vehicle
and which orders are allowed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, cast

from dsse_ros.base.result import Result
from dsse_ros.vehicles.autopilots import AUTOPILOTS
from dsse_ros.vehicles.control.orders import (
    FlyMission,
    GoTo,
    Hold,
    Land,
    MakeReady,
    Return,
    SearchPlace,
    TakeOff,
)
from dsse_ros.vehicles.control.vehicle_controller import Order, Outcome
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.custody import ENDS, MAY_ORDER, Custody, Event
from dsse_ros.vehicles.fleet.flight_record import FlightRecord, SearchId
from dsse_ros.vehicles.fleet.foreign_acts import RISEN_M
from dsse_ros.vehicles.fleet.layer import Layer, Task
from dsse_ros.vehicles.fleet.pace_watch import PaceWatch
from dsse_ros.vehicles.fleet.place_watch import Low, PlaceWatch, waits_over_home
from dsse_ros.vehicles.fleet.progress import GivenOrder, LegProgress, Wanted
from dsse_ros.vehicles.fleet.settings import BridgeSettings
from dsse_ros.vehicles.fleet.take_off import Lack, Readiness, lack_of, reason_to_stay
from dsse_ros.vehicles.fleet.vehicle_custody import Arm, VehicleCustody
from dsse_ros.vehicles.mission_items.track_missions import VehicleLeg


@dataclass(frozen=True)
class Permissions:
    """Permissions of a vehicle, from the other vehicles and the search.

    Attributes:
        search_alive: Whether the search is running; without it no vehicle takes off.
        take_off: Why the vehicle must not take off yet.
        home: Place to fly to, at its altitude, before it comes down there; None to come down at
            once.
        admit: Returns the order to give instead of the wanted one, or why that has to wait.
        intruder: Returns why an order under way has to be interrupted.
    """

    search_alive: bool = True
    take_off: str | None = None
    home: GoTo | None = None
    admit: Callable[[Order], Order | str] = lambda order: order
    intruder: Callable[[Order | None], str | None] = lambda order: None


class Seen(NamedTuple):
    """What the bridge sees of a vehicle at one time.

    Attributes:
        state: State that the vehicle reports.
        outcome: Outcome of its last order.
        now_s: Time on a steady clock, the one of `state.heard_s`.
        trouble: What is wrong with its link.
    """

    state: VehicleState
    outcome: Outcome
    now_s: float
    trouble: str | None = None


class Departure(NamedTuple):
    """Where a vehicle in the air has gone without an order; the defaults if it has not left.

    Attributes:
        from_place: Whether it has left the place at which it had arrived.
        off_leg: How it has left the leg to which it flies by setpoints.
        off_mission: How it has left the legs of its mission.
        falls: Whether it is below the lowest altitude.
        outside: Why it is outside the fence.
    """

    from_place: bool = False
    off_leg: str | None = None
    off_mission: str | None = None
    falls: bool = False
    outside: str | None = None


class Admission(NamedTuple):
    """What comes of a wanted order.

    Attributes:
        order: The order to give; None if there is no new one.
        wanted: For which it is given.
        blocked: Why another one, or none, is given.
    """

    order: Order | None = None
    wanted: Wanted | None = None
    blocked: str | None = None


class VehicleDispatcher:
    """Gives one vehicle its orders, so that it follows its drone along its legs.

    Args:
        settings: Settings of the bridge.
        record: Its record so far.

    Attributes:
        custody: Who controls it.
        progress: How far it is with the current leg.
        given_order: Its last order.
        readiness: What it still needs before it takes off.
        risen: Whether it has been at its altitude in this search.
        pace_watch: How fast it flies along its legs.
        strays: How it has left the leg to which it flies by setpoints; None if it is on it.
        leaves_layer: Why it would leave its layer to return by itself; None if it would not.
    """

    def __init__(self, settings: BridgeSettings, record: FlightRecord | None = None) -> None:
        self._settings = settings
        self._autopilot = AUTOPILOTS[settings.autopilot]
        self._as_mission = settings.mode == "mission"
        self._place_watch = PlaceWatch(self._autopilot.circle_m)
        self.pace_watch = PaceWatch()
        self.strays: str | None = None
        self._layer: Layer | None = None
        self.leaves_layer: str | None = None
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
        self.readiness = Readiness()
        self._admission = Admission()
        self.risen = False
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
    def refused(self) -> str | None:
        """Why the task, or the take-off, is refused."""
        stays = self.readiness.no_take_off
        return f"take-off: {stays}" if stays else self.progress.refused

    @property
    def lost(self) -> str | None:
        """Why the vehicle no longer follows its drone."""
        return self.custody.lost

    @property
    def blocked(self) -> str | None:
        """What keeps it from doing what it should."""
        return self._admission.blocked or self.readiness.blocked

    @property
    def unplaced(self) -> str | None:
        """Why nobody knows where it flies; None if it knows."""
        seen = self.custody.seen
        return "flies by dead reckoning, without GPS" if seen.flying and seen.dead_reckons else None

    @property
    def off_plan(self) -> str | None:
        """How it flies otherwise than planned."""
        return self.unplaced or self.strays or self.pace_watch.slow

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
        return self.is_awaited and not self.readiness.ready

    @property
    def takes_off(self) -> bool:
        """Whether it was ordered to take off, and is on the ground."""
        ordered = isinstance(self.given_order.order, TakeOff | FlyMission)
        return ordered and self.custody.state is Custody.CLEARED

    @property
    def finished(self) -> bool:
        """Whether it has nothing left to do in this search."""
        custody, last = self.custody, self.given_order
        if self.progress.leg is None:
            return False
        if custody.airborne and custody.seen.connected:
            at_rest = last.done and last.order == ENDS[self._settings.at_end]
            return custody.state is Custody.ENDING and at_rest
        return custody.is_out

    @property
    def is_awaited(self) -> bool:
        """Whether it should take off for the followed search."""
        custody = self.custody
        return self.progress.leg is not None and not custody.airborne and not custody.is_out

    # A turn: seen -> events -> wanted -> admitted

    def advance(
        self,
        state: VehicleState,
        outcome: Outcome,
        now_s: float,
        trouble: str | None = None,
        permissions: Permissions | None = None,
    ) -> Order | None:
        """Return the order to give now, None if there is no new one.

        Args:
            state: See `Seen`.
            outcome: See `Seen`.
            now_s: See `Seen`.
            trouble: See `Seen`.
            permissions: What the other vehicles and the search allow it to do.
        """
        permissions = permissions or Permissions()
        seen = Seen(state, outcome, now_s, trouble)
        self._take_events(seen, permissions)
        wanted = self._wanted(state, permissions) if state.connected else None
        self._admission = self._admit(wanted, now_s, permissions)
        order, given_for, _ = self._admission
        if order is not None and given_for is not None:
            self.given_order.give(order, given_for)
            self.custody.record_order(order)
        return order

    def await_identity(self, state: VehicleState, now_s: float, trouble: str | None) -> None:
        """Let time pass while it is not known which vehicle is connected."""
        self._admission = Admission()
        self._await_take_off(Seen(state, Outcome(), now_s, trouble), Permissions())

    # Events

    def _take_events(self, seen: Seen, permissions: Permissions) -> None:
        """Take all that has happened, in the order in which one thing explains the next.

        An order that has ended may end the search for the vehicle; who controls it tells whether
        its flight says anything about it; and only one that nothing has taken is cleared, and
        waits for its take-off.
        """
        custody, progress, state, now_s = self.custody, self.progress, seen.state, seen.now_s
        self._take_outcome(seen)
        custody.over = self._is_over()
        custody.observe(state, seen.outcome, now_s)
        custody.lapse(now_s)
        self.risen |= state.has_position and state.alt_amsl_m > custody.top_amsl_m - RISEN_M
        if self.mission_under_way and waits_over_home(progress.due, state, self._autopilot):
            progress.arrived = custody.over = True
        if custody.over and custody.record.search == custody.search:
            custody.handle(Event.SEARCH_OVER)
        ours = custody.airborne or custody.state is Custody.CLEARED
        self._take_departure(self._departure(seen) if ours else Departure(), state)
        gone = self._gone(seen) if ours else None
        if gone:
            custody.drop_out(gone)
        self._watch_pace(state)
        custody.clear_automatically(now_s)
        self._await_take_off(seen, permissions)

    def _take_outcome(self, seen: Seen) -> None:
        """Go on in the task after an order that is done; drop out after one that has failed."""
        last, due = self.given_order, self.progress.due
        fails = last.take_outcome(seen.outcome, seen.now_s)
        if last.done and due is not None and last.wanted == self._stamped(due):
            if isinstance(due, SearchPlace):
                self.custody.look_done(self.progress.number)
            self.progress.advance()
        if fails and not self.lost:
            self.custody.drop_out(f"failed: {seen.outcome.reason}")

    def _is_over(self) -> bool:
        """Return whether this vehicle has nothing left to do in the search."""
        custody, progress, leg = self.custody, self.progress, self.progress.leg
        if leg is None or not leg.over:
            return False
        if self._as_mission:
            record = custody.record
            landed = record.flown and record.search == custody.search and not custody.airborne
            # It stays over if it is then cleared for another search.
            return custody.over or progress.arrived or landed
        done = progress.arrived or progress.late or leg.collided
        return done or not progress.task or custody.state is not Custody.FOLLOWING

    def _departure(self, seen: Seen) -> Departure:
        """Return where a vehicle of ours has gone without an order."""
        state, now_s = seen.state, seen.now_s
        custody, layer, progress = self.custody, self._layer, self.progress
        if not state.flying:
            self._place_watch = PlaceWatch(self._autopilot.circle_m)
        if not (state.connected and state.flying and state.has_position):
            return Departure()
        watch, task = self._place_watch, progress.due
        stays = progress.arrived and custody.state is Custody.FOLLOWING
        place = task if stays and isinstance(task, GoTo) else None
        from_place = watch.has_left(place, state, now_s)
        if layer is None or not custody.airborne:
            return Departure(from_place)
        flown = task if self.mission_under_way else self.given_order.under_way
        off = watch.strays(flown, state, now_s, self._autopilot)
        off_leg, off_mission = (None, off) if isinstance(flown, FlyMission) else (off, None)
        falls, outside = watch.falls(state, now_s, layer.fence, self._low_reason(state)), None
        if not (falls or self._as_mission):
            # A mission goes on without the bridge, and all of it is checked before.
            outside = watch.outside(state, now_s, layer.fence)
        return Departure(from_place, off_leg, off_mission, falls, outside)

    def _take_departure(self, departure: Departure, state: VehicleState) -> None:
        """Order it back to its place, or recognise who else, or what, moves it."""
        custody, progress = self.custody, self.progress
        if departure.from_place:
            progress.arrived, self.given_order.wanted = False, None
        # It may be a wind, or a motor: who moves it is seen by its mode and its target.
        self.strays = f"is {departure.off_leg}" if departure.off_leg else None
        if departure.off_mission:
            # Nothing but somebody's order takes an autopilot off its mission.
            custody.take_over(departure.off_mission)
        if departure.falls:
            custody.fall(f"fell to {state.alt_m:.0f} m above home without an order")
            progress.arrived = False
        elif departure.outside and custody.state is Custody.FOLLOWING:
            custody.drop_out(f"outside the fence: {departure.outside}")

    def _gone(self, seen: Seen) -> str | None:
        """Return why it can no longer be flown."""
        state, timeout_s = seen.state, self._settings.lost_timeout
        if state.unfit:
            return state.unfit
        silent = bool(state.mode) and not state.connected
        if silent and seen.now_s - state.heard_s >= timeout_s and not self.lost:
            why = f": {seen.trouble}" if seen.trouble else ""
            return f"link lost: no heartbeat for {timeout_s:g} s{why}"
        return None

    def _watch_pace(self, state: VehicleState) -> None:
        """Compare how fast it flies along its leg with how fast it should."""
        progress, follows = self.progress, self.custody.state is Custody.FOLLOWING
        if not (follows and self.follows_leg) or self._as_mission:
            self.pace_watch.forget()
        elif state.connected and self.risen and self._layer is not None:
            waits = progress.arrived or isinstance(self.given_order.order, Hold)
            self.pace_watch.update(None if waits else progress.due, state, self._layer.step_s)

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

    # Before the take-off

    def _await_take_off(self, seen: Seen, permissions: Permissions) -> None:
        """Recognise what keeps it from taking off; drop out if that takes too long."""
        self.readiness = self._check_take_off(seen, permissions)
        lack, timeout_s = self.readiness.lack, self._settings.join_timeout
        if lack is not None and seen.now_s - self.readiness.lacks_since_s > timeout_s:
            self.custody.drop_out(lack.text(f" within {timeout_s:g} s"))

    def _check_take_off(self, seen: Seen, permissions: Permissions) -> Readiness:
        if not self.is_awaited:
            return Readiness()
        custody, state, before = self.custody, seen.state, self.readiness
        no_take_off = before.no_take_off
        lack = self._lack_of_report(seen)
        if lack is None and self._could_take_off(state):
            assert self._layer is not None
            no_take_off = reason_to_stay(state, self._layer)
            lack = Lack("no take-off", no_take_off) if no_take_off else self._unready(seen)
        if lack is not None:
            since_s = min(before.lacks_since_s, seen.now_s)
            return Readiness(False, lack.text(), no_take_off, lack, since_s)
        if custody.state is Custody.CLEARED:
            return Readiness(True, permissions.take_off, no_take_off)
        # Waiting for a person has no timeout.
        in_the_air = state.flying or state.armed
        # In the air it is cleared alone.
        alone = custody.state is Custody.RELEASED and in_the_air and not self._as_mission
        clears = "drone<i>/arm clears it to fly" if alone else "~/arm clears it to fly"
        return Readiness(False, f"{custody.holder}: {clears}", no_take_off)

    def _lack_of_report(self, seen: Seen) -> Lack | None:
        """Return what the vehicle has not reported yet."""
        lack = lack_of(seen.state, seen.trouble)
        homeless = self._as_mission and not self.progress.has_task
        if lack is None and seen.state.connected and homeless:
            return Lack("no home position", seen.trouble or seen.state.unready)
        return lack

    def _could_take_off(self, state: VehicleState) -> bool:
        return state.connected and self.custody.state is Custody.CLEARED and not state.armed

    def _unready(self, seen: Seen) -> Lack | None:
        """Return why its autopilot is not ready to take off."""
        # Readiness may depend on the mode, which `MakeReady` sets.
        prepared = not isinstance(self.given_order.under_way, MakeReady)
        if seen.state.ready and prepared:
            return None
        waits = None if self.given_order.order is None else seen.outcome.reason
        return Lack("not ready", waits or seen.trouble or seen.state.unready)

    # What is admitted

    def _admit(self, order: Order | None, now_s: float, permissions: Permissions) -> Admission:
        """Return the order to give now, if custody allows it, and the other vehicles do."""
        if order is None or not isinstance(order, MAY_ORDER[self.custody.state]):
            return Admission()
        wanted, last = self._stamped(order), self.given_order
        # A vehicle that has dropped out, or was recalled, does not wait for others.
        waits = not self.lost and self.custody.state is not Custody.RECALLED
        if wanted == last.wanted:
            stops = waits and self._may_stop and not last.done
            intruder = permissions.intruder(last.order) if stops else None
            if intruder:
                return Admission(Hold(), Wanted(Hold()), intruder)
            if not last.is_due_again(now_s):
                return Admission()
        admitted = permissions.admit(order) if waits else order
        if isinstance(admitted, str):
            return Admission(blocked=admitted)
        return Admission(admitted, wanted)

    @property
    def _may_stop(self) -> bool:
        """Whether it may be ordered to hold where it is; one that circles would stay near."""
        hovers = not (self._as_mission or self._autopilot.circles)
        return hovers and Hold in MAY_ORDER[self.custody.state]

    def _stamped(self, order: Order) -> Wanted:
        return Wanted(order, self.progress.number if isinstance(order, SearchPlace) else 0)

    # What is wanted

    def _wanted(self, state: VehicleState, permissions: Permissions) -> Order | None:
        """Return what the vehicle should be doing, None where no order is needed."""
        match self.custody.state:
            case Custody.CLEARED:
                return self._wanted_on_the_ground(state, permissions)
            case Custody.FOLLOWING:
                return self._wanted_in_the_air(state)
            case Custody.HELD:
                return Hold(self._mode_of_others)
            case Custody.RECALLED:
                record, from_mode = self.custody.record, self._mode_of_others
                return Land(from_mode) if record.end == "land" else Return(from_mode)
            case Custody.ENDING:
                return self._wanted_at_the_end(state, permissions)
        return None

    @property
    def _mode_of_others(self) -> str | None:
        """The mode of somebody else from which an operator has taken it."""
        modes = self.custody.record.from_modes
        return modes[0] if modes else None

    def _wanted_on_the_ground(self, state: VehicleState, permissions: Permissions) -> Order | None:
        if not self.is_awaited or not state.has_position:
            return None
        arm, modes = self.custody.record.arm, self.custody.record.from_modes
        refused = bool(self.refused) or not permissions.search_alive
        if refused or permissions.take_off or not (self.readiness.ready or self.takes_off):
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

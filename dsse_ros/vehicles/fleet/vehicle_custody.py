# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Custody of one vehicle, from what it reports, from searches and from persons.

This module alone recognises what persons and failsafes do. Under an order the vehicle's controller
sees it, and the order's outcome reports it; the rest is seen here. `VehicleDispatcher` reports the
end of the search, and why the vehicle drops out of it or falls. The `FlightRecord` outlasts the
program.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

from dsse_ros.base.result import Accepted, Rejected, Result
from dsse_ros.vehicles.autopilots import Autopilot, Failsafe
from dsse_ros.vehicles.control.identity import DOUBLE
from dsse_ros.vehicles.control.orders import FlyMission, Hold, TakeOff
from dsse_ros.vehicles.control.vehicle_controller import Order, Outcome
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.custody import AIRBORNE, Custody, Event, next_custody
from dsse_ros.vehicles.fleet.failsafe_watch import FailsafeWatch
from dsse_ros.vehicles.fleet.flight_record import FlightRecord, SearchId, entering
from dsse_ros.vehicles.fleet.foreign_acts import foreign_act, is_ours, lacks_setpoints, modes_of

Arm = Literal["false", "true", "always"]
"""Which searches clear a vehicle: the first one, and a person arms it (`false`) or the bridge does
(`true`), or each one (`always`)."""
_ENDS_ON_THE_GROUND = (Custody.FAILSAFE, Custody.RELEASED)
CONSENT_S = 600.0
"""Time for which a clearance without a search waits for one."""
_EXPLAINED_S = 3.0
"""How much later than its mode the cause of a failsafe may be reported: ArduCopter's text comes
within a second of its heartbeat."""
_OFF_THE_GROUND_M = 2.0
_DISARMED_BEATS = 2
"""Heartbeats that prove that it was disarmed: one may be that of another vehicle with its id."""
_DOUBLE_S = 10.0
"""Time in which it may turn out that not a person took it, but another vehicle has its id."""
_DISARMED_BEATS_OF_TWO = 5
"""Heartbeats that prove it where two vehicles have its id: the armed one would be heard too."""
_TAKES_BACK = (Event.HOLD, Event.COME_DOWN, Event.DOUBLE)
"""Events by which the bridge takes a vehicle back that it did not fly."""
_KEPT = "kept on the ground"
_NO_SEARCH = "no search goes on for it: ~/return or ~/land brings it down"
_CIRCLES = "ordered to return, and to circle over home until a pilot lands it"
_COMING_DOWN = "coming down: clear it once it is down"
_CRASHED = "it has crashed: drone<i>/arm alone clears it"


class _Consent(NamedTuple):
    """The latest consent of a person, or of the parameter `arm`, to fly the vehicle.

    Attributes:
        authority: Its number: see `VehicleController.give`.
        known_order: The highest number of an order of which it was known then whether somebody else
            had ended it. How a later one ends counts against the consent.
        given_s: When the vehicle was cleared; infinity for a call in the air.
    """

    authority: int = 0
    known_order: int = 0
    given_s: float = math.inf


class _Taken(NamedTuple):
    """How somebody else seemed to take the vehicle in the air.

    Attributes:
        since_s: When.
        mode: The mode that the bridge had set.
    """

    since_s: float
    mode: str | None


@dataclass
class _Sight:
    """What this program has seen of the connected vehicle.

    Attributes:
        state: State that it reported last.
        now_s: When that was.
        has_run: Whether its motors have turned since it was seen to stand on the ground.
        explained_until_s: Until when a failsafe may explain the mode that took it.
        failsafes: Tells which of its failsafes have it.
    """

    state: VehicleState = field(default_factory=VehicleState)
    now_s: float = -math.inf
    has_run: bool = False
    explained_until_s: float = -math.inf
    failsafes: FailsafeWatch = field(default_factory=FailsafeWatch)


class VehicleCustody:
    """Recognises the events of a vehicle, and keeps its record.

    Args:
        autopilot: Autopilot of the vehicle.
        arm: See `Arm`.
        record: Its record so far.
        as_mission: Whether the vehicle flies searches as missions, which land by themselves.
        changed: Called after each change of state except lift-off: earlier orders are void.

    Attributes:
        record: What a restarted program must know about the vehicle.
        search: The followed search; None for none.
        over: Whether this vehicle has nothing left to do in that search.
        top_amsl_m: Altitude above mean sea level to which it takes off in that search.
    """

    def __init__(
        self,
        autopilot: Autopilot,
        arm: Arm,
        record: FlightRecord,
        changed: Callable[[], None],
        *,
        as_mission: bool = False,
    ) -> None:
        self._autopilot = autopilot
        self._arm = arm
        self.record = record
        self._changed = changed
        self._as_mission = as_mission
        self.search: SearchId | None = None
        self.over = False
        self.top_amsl_m = 0.0
        # Whether that search is the first one of this program, and the parameter `arm` may still
        # clear the vehicle in it.
        self._is_first = self._automatic = False
        self._sight = _Sight()
        self._consent = _Consent()
        self._taken: _Taken | None = None
        # See `_Consent.known_order`.
        self._known_order = 0

    @property
    def state(self) -> Custody:
        """Who controls the vehicle."""
        return self.record.custody

    @property
    def seen(self) -> VehicleState:
        """State that the vehicle reported last."""
        return self._sight.state

    @property
    def authority(self) -> int:
        """Number of the latest consent to fly it: see `VehicleController.give`."""
        return self._consent.authority

    @property
    def airborne(self) -> bool:
        """Whether the bridge flies it."""
        return self.state in AIRBORNE

    @property
    def lost(self) -> str | None:
        """Why the vehicle no longer follows its drone in the followed search."""
        return self.record.lost if self.record.search == self.search else None

    @property
    def is_out(self) -> bool:
        """Whether the followed search goes on without it, or there is no search."""
        return self.search is None or self.over or bool(self.lost)

    @property
    def holder(self) -> str:
        """Who controls the vehicle, in words."""
        return _holder(self.state, self.seen)

    def handle(self, event: Event) -> None:
        """Handle an event: custody changes, and the record with it."""
        before = self.state
        custody = next_custody(before, event)
        if custody is before:
            return
        if before in AIRBORNE and custody in (Custody.TAKEN, Custody.FAILSAFE):
            self._taken = _Taken(self._sight.now_s, self.record.mode)
        self.record = entering(self.record, custody, self.seen.mode)
        if event is Event.CLEAR or (event in _TAKES_BACK and before not in AIRBORNE):
            self._consent = _Consent(self.authority + 1, self._known_order)
        if event is not Event.LIFT_OFF:
            self._changed()
        ended = before in AIRBORNE and custody not in AIRBORNE
        # A search that has begun during the flight waits for its end.
        if ended and self.search is not None and self.record.search != self.search:
            self._join(self.search)

    def mark_lost(self, why: str) -> None:
        """Continue the search without this vehicle, unless it has nothing left to do there."""
        if not self.is_out and self.record.search == self.search:
            self.record = replace(self.record, lost=why)

    def drop_out(self, why: str) -> None:
        """Stop following the drone."""
        self.mark_lost(why)
        self.handle(Event.DROP_OUT)

    def replace_vehicle(self, record: FlightRecord) -> None:
        """Take the record of another vehicle that has turned out to be connected."""
        self.record, self.over, self._sight = record, False, _Sight()
        self._consent = self._consent._replace(known_order=self._known_order)
        if self.search is not None:
            self.begin(self.search, self.top_amsl_m, first=self._is_first)

    # Searches

    def begin(self, search: SearchId, top_amsl_m: float, *, first: bool) -> None:
        """Follow a search; with `first`, the first of this program, it may clear the vehicle."""
        self.search, self.top_amsl_m, self.over = search, top_amsl_m, False
        self._is_first = first
        self._automatic = first or self._arm == "always"
        if self.record.search == search:
            return
        if self.record.search is not None:
            self.handle(Event.SEARCH_OVER)
        if not self.airborne:
            self._join(search)

    def leave(self) -> None:
        """Follow no search."""
        self.search = None
        self.handle(Event.SEARCH_OVER)

    def _join(self, search: SearchId) -> None:
        self.record = replace(
            self.record, search=search, top_amsl_m=self.top_amsl_m, flown=False, lost=None,
            looked=-1,
        )  # fmt: skip

    # Persons

    def clear(self, now_s: float, *, alone: bool = False, search_alive: bool = True) -> Result[str]:
        """Clear it to fly for an operator; returns for which search, or why it is refused.

        Args:
            now_s: Time on a steady clock.
            alone: Whether the operator has cleared this vehicle alone, not the whole fleet.
            search_alive: Whether a search is running.
        """
        custody, seen = self.state, self.seen
        released = custody is Custody.RELEASED and alone and not self.is_out
        if custody in (Custody.HELD, Custody.RECALLED) or released:
            return self._clear_in_the_air(search_alive=search_alive)
        if custody is Custody.FOLLOWING:
            goes_on = search_alive or self._as_mission
            return Accepted("cleared to fly") if goes_on else Rejected("no_search", _NO_SEARCH)
        if seen.unfit or not seen.mode:
            return Rejected("unfit", seen.unfit or "no heartbeat")
        if custody is Custody.ENDING:
            return Rejected("in_the_air", _COMING_DOWN)
        if custody is Custody.CRASHED and not alone:
            return Rejected("crashed", _CRASHED)
        if seen.flying or seen.armed:
            self.mark_lost(self.holder)
            return Rejected("in_the_air", f"in the air, {self.holder}: clear it once it is down")
        # The operator has seen its mode, so the bridge may change that mode.
        self._clear(now_s, arm=True, by="~/arm", modes=(seen.mode,))
        later = self.record.search is None
        return Accepted("cleared for the next search" if later else "cleared to fly")

    def _clear(self, now_s: float, *, arm: bool, by: str, modes: Iterable[str] = ()) -> None:
        before = self.record
        self.handle(Event.CLEAR)
        if before.custody not in (Custody.CLEARED, Custody.FREE):
            self.record = replace(
                self.record, cleared_from=before.custody, cleared_lost=before.lost
            )
        # If the search is over for it, the clearance is for the next one.
        search = None if self.over else self.search
        self._consent = self._consent._replace(given_s=now_s)
        self.record = replace(
            self.record, search=search, top_amsl_m=self.top_amsl_m, lost=None, looked=-1,
            arm=arm, cleared_by=by, from_modes=tuple(modes),
        )  # fmt: skip

    def _clear_in_the_air(self, *, search_alive: bool) -> Result[str]:
        if self._as_mission:
            why = "in the air, and its mission does not go on: clear it once it is down"
            return Rejected("in_the_air", why)
        if self.is_out or not search_alive:
            comes_down = self.state is Custody.RECALLED
            return Rejected("no_search", _COMING_DOWN if comes_down else _NO_SEARCH)
        self.handle(Event.CLEAR)
        if self.search is not None and self.record.search != self.search:
            self._join(self.search)
        self.record = replace(self.record, flown=True, from_modes=())
        return Accepted("cleared to fly")

    def lapse(self, now_s: float) -> None:
        """End a clearance for a search to come if none has come."""
        waits = self.state is Custody.CLEARED and self.record.search is None
        if waits and now_s - self._consent.given_s > CONSENT_S:
            self.handle(Event.SEARCH_OVER)

    def clear_automatically(self, now_s: float) -> None:
        """Clear it according to the parameter `arm`, if that applies to this search."""
        if not self._automatic or self.seen.unfit or not self.seen.connected or self.is_out:
            return
        always = self._arm == "always"
        flown = self.record.flown and self.record.search == self.search
        match self.state:
            case Custody.FREE:
                self._clear_on_the_ground(now_s)
            case Custody.GROUNDED if always and not flown:
                self._clear_on_the_ground(now_s)
            case Custody.CLEARED:
                self._automatic = False
                self.record = replace(self.record, arm=self.record.arm or self._arm != "false")
            case Custody.RELEASED | Custody.ENDING if always:
                self._automatic = False
                self._clear_in_the_air(search_alive=True)
            case Custody.FAILSAFE if always:
                # Once it is down or released, this clears it.
                self.mark_lost(self.holder)
            case Custody.TAKEN if always:
                self._automatic = False
                self.mark_lost(self.holder)
            case Custody.HELD | Custody.RECALLED if always:
                # It was not free when the search began, so this search cannot clear it later.
                self._automatic = False

    def _clear_on_the_ground(self, now_s: float) -> None:
        """Clear it by the parameter `arm` if it is down; `always` waits until it is."""
        down, always = not (self.seen.armed or self.seen.flying), self._arm == "always"
        self._automatic = always and not down
        if down:
            modes = sorted(self._autopilot.landed_modes) if always else ()
            arms, by = self._arm != "false", f"arm:={self._arm}"
            self._clear(now_s, arm=arms, by=by, modes=modes)

    def ground(self) -> Result[str]:
        """Keep it on the ground for an operator; returns what was done, or why not."""
        if self.airborne or self.seen.flying:
            return Rejected("in_the_air", "in the air: hold it, or have it return or land")
        self.mark_lost("kept on the ground by the operator")
        self.handle(Event.GROUND)
        return Accepted(_KEPT)

    def operate(self, what: str) -> Result[str]:
        """Make it `hold`, `return` or `land`; returns what was done, or why not.

        A vehicle in the air always obeys, no matter who controls it, and who has launched it.
        """
        if self.state is Custody.CLEARED and self.seen.armed:
            self.handle(Event.LIFT_OFF)
        in_the_air = self.seen.flying or (self.seen.armed and what != "hold")
        if not (self.airborne or in_the_air):
            return self.ground()
        self._sight.failsafes.overrule(self.seen)
        if what == "hold":
            self._hold()
            return Accepted("ordered to hold")
        self._recall(what, f"recalled by the operator: {what}", Event.COME_DOWN)
        return Accepted(_CIRCLES if self._autopilot.circles else f"ordered to {what}")

    def _hold(self) -> None:
        """Hold it, even from a mode that somebody else has set; then it is out of the search."""
        modes = () if self.airborne else (self.seen.mode,)
        if modes:
            self.mark_lost("held by the operator")
        self.handle(Event.HOLD)
        self.record = replace(self.record, from_modes=modes)

    def _recall(self, end: str, why: str, event: Event) -> None:
        """Make it `return` or `land`, even from a mode that somebody else has set."""
        self.mark_lost(why)
        if end != self.record.end:
            self._changed()
        modes = () if self.airborne else (self.seen.mode,)
        self.handle(event)
        self.record = replace(self.record, end=end, from_modes=modes)

    def take_over(self, what: str) -> None:
        """Recognise by its flight that somebody else controls it."""
        self._take_over(what, self.seen)

    def fall(self, why: str) -> None:
        """Have it land, because it falls without an order."""
        self._recall("land", why, Event.FALL)

    # Orders

    def record_order(self, order: Order) -> None:
        """Record an order that is about to be given."""
        arms = isinstance(order, TakeOff | FlyMission) and order.arm and not self.seen.armed
        launched, ordered = self.record.launched or arms, modes_of(order, self._autopilot)
        self.record = replace(self.record, launched=launched, ordered=ordered)

    def look_done(self, number: int) -> None:
        """Record that it has searched for the leg of this number."""
        self.record = replace(self.record, looked=number)

    def rest(self) -> None:
        """Record, as the program ends, that it is ordered to hold."""
        if self.airborne and self.record.mode == self._autopilot.guided_mode:
            ordered = (*self.record.ordered, *modes_of(Hold(), self._autopilot))
            self.record = replace(self.record, ordered=ordered)

    # The vehicle

    def observe(self, state: VehicleState, outcome: Outcome, now_s: float) -> None:
        """Recognise who controls the vehicle.

        Args:
            state: Its reported state.
            outcome: Outcome of the last order.
            now_s: Time on a steady clock.
        """
        before, self._sight.state, self._sight.now_s = self.seen, state, now_s
        if state.identity.restarts > before.identity.restarts and self.state is not Custody.FREE:
            self.mark_lost("taken over: its autopilot was restarted")
            self.handle(Event.TAKE_OVER)
        self._observe_outcome(state, outcome)
        self._explain(state)
        if state.connected and state.mode:
            self._observe_foreign_acts(before, state, outcome)
            self._observe_mode(before, state)
            if outcome.order is None:
                self._observe_without_order(state)
            self._observe_crash(before, state)
            self._observe_motors(state, outcome)
            if self.airborne and is_ours(self.record, state, self._autopilot):
                self.record = replace(self.record, mode=state.mode)
        self._observe_failsafe(state, outcome, now_s)
        self._observe_double(state)

    def _observe_double(self, state: VehicleState) -> None:
        """Recognise that what seemed to be somebody's act was another vehicle with its id."""
        taken = self._taken if self.state in (Custody.TAKEN, Custody.FAILSAFE) else None
        if taken is None or not state.identity.has_double:
            return
        lately = self._sight.now_s - taken.since_s <= _DOUBLE_S
        if lately and state.armed and state.flying and state.mode == taken.mode:
            self._recall("return", DOUBLE, Event.DOUBLE)
            self.record = replace(self.record, lost=DOUBLE)

    def _observe_outcome(self, state: VehicleState, outcome: Outcome) -> None:
        """Take what the controller has seen under an order."""
        ended = outcome.status in ("taken_over", "failsafe")
        self._known_order = outcome.number if ended else outcome.number - 1
        ours = self.airborne or self.state is Custody.CLEARED
        if ours and outcome.number > self._consent.known_order:
            if outcome.status == "taken_over":
                self._take_over(outcome.reason or f"in {state.mode}", state)
            elif outcome.status == "failsafe":
                self._fail(state, Event.FAILSAFE)

    def _observe_without_order(self, state: VehicleState) -> None:
        """Recognise a mode that somebody else has set, since an earlier program saw its last."""
        if not (self.airborne and state.armed) or lacks_setpoints(
            self.record, state, self._autopilot
        ):
            return
        if is_ours(self.record, state, self._autopilot) is False:
            if state.failsafe:
                self._fail(state, Event.FAILSAFE)
            else:
                self._take_over(f"in {state.mode}", state)

    def _observe_failsafe(self, state: VehicleState, outcome: Outcome, now_s: float) -> None:
        """Recognise a failsafe that does not change the mode, or takes the vehicle later."""
        ordered, acts = outcome.order is not None, self._autopilot.acts_when_critical
        concerns = self.airborne or (ordered and self.state is Custody.CLEARED)
        known = ordered or acts
        if self._sight.failsafes.acts(state, now_s, concerns=concerns, known=known):
            self._fail(state, Event.DROP_OUT if ordered and not acts else Event.FAILSAFE)

    def _fail(self, state: VehicleState, event: Event) -> None:
        self.mark_lost(_lost_to(state.failsafe or Failsafe.CRITICAL))
        self.handle(event)

    def _take_over(self, what: str, state: VehicleState) -> None:
        self.mark_lost(f"taken over: {what}")
        self.handle(Event.TAKE_OVER)
        foreign = state.flying and state.mode not in self._autopilot.take_off_modes
        self._sight.explained_until_s = state.heard_s + _EXPLAINED_S if foreign else -math.inf

    def _explain(self, state: VehicleState) -> None:
        """Recognise the failsafe that has taken it away, reported after its effect."""
        if state.failsafe in (None, Failsafe.CRITICAL, Failsafe.OFFBOARD):
            return
        explains = state.heard_s < self._sight.explained_until_s
        if explains:
            self._sight.explained_until_s = -math.inf
            self.handle(Event.EXPLAIN)
        unnamed = self.record.lost == _lost_to(Failsafe.CRITICAL)
        if self.record.lost and (explains or unnamed):
            self.record = replace(self.record, lost=_lost_to(state.failsafe))

    def _observe_foreign_acts(
        self, before: VehicleState, state: VehicleState, outcome: Outcome
    ) -> None:
        """Recognise that somebody else has changed what a vehicle in the air flies."""
        if not (self.airborne and state.flying) or state.identity.has_double:
            return
        act = foreign_act(self.record, before, state)
        if act:
            self._take_over(act, state)
            # What that person has set is no act against a later order of an operator.
            self.record = replace(self.record, home=state.home, items=0, plan=None)
            return
        risen = state.alt_m > _OFF_THE_GROUND_M
        if risen and self.record.home is None and state.home is not None:
            self.record = replace(self.record, home=state.home)
        order = outcome.order
        if isinstance(order, FlyMission) and state.mode in self._autopilot.mission_modes:
            items = len(order.items) - self._autopilot.first_item
            # An autopilot that does not report the number reports 0.
            if state.item_total == items != self.record.items:
                self.record = replace(self.record, items=items)
            if state.mission and not self.record.plan:
                self.record = replace(self.record, plan=state.mission)

    def _observe_mode(self, before: VehicleState, state: VehicleState) -> None:
        if state.identity.has_double:
            # Whose mode that is, nobody knows.
            return
        autopilot = self._autopilot
        guided_mode = autopilot.guided_mode
        on_the_ground = not (before.armed or state.armed) and bool(before.mode)
        usual_modes = autopilot.boot_modes | autopilot.orderly_modes
        if on_the_ground and before.mode != state.mode and state.mode not in usual_modes:
            self._take_over(f"in {state.mode}", state)
        if before.armed and state.armed and before.mode != guided_mode == state.mode:
            self.handle(Event.RELEASE)
        if self.state is Custody.RELEASED and state.mode not in autopilot.orderly_modes:
            self.handle(Event.FAILSAFE if state.failsafe else Event.TAKE_OVER)

    def _observe_crash(self, before: VehicleState, state: VehicleState) -> None:
        if state.crashed and not before.crashed and not state.identity.has_double:
            self.record = replace(self.record, lost=f"crashed: {state.crashed}", launched=False)
            self._sight.has_run = False
            self.handle(Event.CRASH)

    def _observe_motors(self, state: VehicleState, outcome: Outcome) -> None:
        cleared = self.state is Custody.CLEARED
        takes_off = cleared and isinstance(outcome.order, TakeOff | FlyMission)
        if state.armed or state.flying:
            self._sight.has_run |= state.armed
            self._observe_running_motors(state, takes_off=takes_off)
            return
        beats = _DISARMED_BEATS if not state.identity.has_double else _DISARMED_BEATS_OF_TWO
        may_be_a_doubles = self._sight.has_run and state.disarmed_beats < beats
        if may_be_a_doubles or not state.settled:
            return
        if self.airborne or self.state in _ENDS_ON_THE_GROUND or self._sight.has_run:
            if self.state is Custody.FOLLOWING and not self._as_mission:
                self.mark_lost("on the ground again before the end of the search")
            self.handle(Event.DOWN)
        if self._sight.has_run or not takes_off:
            self.record = replace(self.record, launched=False, home=None, items=0, plan=None)
        self._sight.has_run = False

    def _observe_running_motors(self, state: VehicleState, *, takes_off: bool) -> None:
        if self.state in (Custody.GROUNDED, Custody.CRASHED):
            armed = f"armed by somebody else, in {state.mode}"
            if self.state is Custody.CRASHED and self.record.lost:
                self.record = replace(self.record, lost=f"{self.record.lost}; {armed}")
            self._take_over(armed, state)
        if self.state is not Custody.CLEARED:
            return
        autopilot = self._autopilot
        modes = autopilot.take_off_modes
        if self._as_mission:
            modes |= autopilot.mission_modes
        if takes_off and state.mode in modes:
            self.handle(Event.LIFT_OFF)
        elif self.record.arm or state.flying or state.mode not in modes:
            self._take_over(f"armed by somebody else, in {state.mode}", state)


def _lost_to(failsafe: Failsafe) -> str:
    """Return why a vehicle is lost that a failsafe controls."""
    return f"{failsafe.value} failsafe"


def _holder(custody: Custody, seen: VehicleState) -> str:
    """Return who controls a vehicle, in words.

    Args:
        custody: Who controls it.
        seen: State that it reported last.
    """
    mode = seen.mode or "no known mode"
    # It was landed by a person, or recalled by an operator.
    down = bool(seen.mode) and not (seen.armed or seen.flying)
    return {
        Custody.TAKEN: f"{'it stays down' if down else 'a person controls it'}, in {mode}",
        Custody.FAILSAFE: f"a failsafe controls it, in {mode}",
        Custody.RELEASED: f"nobody controls it, in {mode}",
        Custody.GROUNDED: "it has flown or dropped out before",
        Custody.CRASHED: "it has crashed",
    }.get(custody, f"nobody has cleared it, in {mode}")

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Custody of one vehicle, from what it reports, from searches and from persons.

This module alone recognises what persons and failsafes do. Under an order the vehicle's controller
sees it, and the order's outcome reports it; the rest is seen here. `VehicleFollower` reports the
end of the search, and why the vehicle drops out of it or falls. The `FlightRecord` outlasts the
program.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Literal

from dsse_ros.autopilots import Autopilot
from dsse_ros.bridge.custody import AIRBORNE, Custody, Event, next_custody
from dsse_ros.bridge.flight_record import FlightRecord, SearchId
from dsse_ros.bridge.foreign_acts import foreign_act, is_ours, lacks_setpoints, modes_of
from dsse_ros.flight.orders import FlyMission, Hold, TakeOff
from dsse_ros.flight.vehicle_controller import Order, Outcome
from dsse_ros.flight.vehicle_state import VehicleState
from dsse_ros.result import Accepted, Rejected, Result

Arm = Literal["false", "true", "always"]
"""Which searches clear a vehicle: the first one, and a person arms it (`false`) or the bridge does
(`true`), or each one (`always`)."""
_ENDS_ON_THE_GROUND = (Custody.FAILSAFE, Custody.RELEASED)
_CONTINUES = ("", "offboard", "radio", "gcs")
"""Failsafes after which the bridge goes on with an autopilot that stays in its mode, or brings it
back to that mode."""
FAILSAFE_S = 5.0
"""Time in which an autopilot may recover that is critical without giving a reason, or that has no
order and a failsafe that keeps its mode."""
CONSENT_S = 600.0
"""Time for which a clearance without a search waits for one."""
_EXPLAINED_S = 3.0
"""How much later than the mode of a failsafe its cause may be reported: ArduCopter's text comes
within a second of its heartbeat."""
_OFF_THE_GROUND_M = 2.0
_DISARMED_BEATS = 2
"""Heartbeats that prove that it was disarmed: one may be that of another vehicle with its id."""
_KEPT = "kept on the ground"
_NO_SEARCH = "no search goes on for it: ~/return or ~/land brings it down"
_CIRCLES = "ordered to return, and to circle over home until a pilot lands it"
_COMING_DOWN = "coming down: clear it once it is down"
_UNNAMED = "critical failsafe"


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
        authority: Number of its latest clearance: see `VehicleController.give`.
        search: The followed search; None for none.
        over: Whether this vehicle has nothing left to do in that search.
        top_amsl_m: Altitude above mean sea level to which it takes off in that search.
        seen: State that the vehicle reported last.
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
        self.authority = 0
        self.search: SearchId | None = None
        self.over = False
        self.top_amsl_m = 0.0
        self.seen = VehicleState()
        self._automatic = False
        self._is_first = False
        self._was_armed = False
        # When it was cleared for a search to come.
        self._cleared_s = math.inf
        # Since when a failsafe is active, and until when one may explain the mode that took it.
        self._failsafe_since_s = math.inf
        self._explained_until_s = -math.inf
        # The highest number of an order for which it is known whether somebody else has ended it,
        # now and at the latest clearance.
        self._number = self._cleared_number = 0

    @property
    def state(self) -> Custody:
        """Who controls the vehicle."""
        return self.record.custody

    @property
    def airborne(self) -> bool:
        """Whether the bridge flies it."""
        return self.state in AIRBORNE

    @property
    def lost(self) -> str:
        """Why the vehicle no longer follows its drone; empty if it does."""
        return self.record.lost if self.record.search == self.search else ""

    @property
    def is_out(self) -> bool:
        """Whether the followed search goes on without it, or there is no search."""
        return self.search is None or self.over or bool(self.lost)

    @property
    def holder(self) -> str:
        """Who controls the vehicle, in words."""
        seen = self.seen
        mode = seen.mode or "no known mode"
        # It was landed by a person, or recalled by an operator.
        down = bool(seen.mode) and not (seen.armed or seen.flying)
        return {
            Custody.TAKEN: f"{'it stays down' if down else 'a person controls it'}, in {mode}",
            Custody.FAILSAFE: f"a failsafe controls it, in {mode}",
            Custody.RELEASED: f"nobody controls it, in {mode}",
            Custody.GROUNDED: "it has flown or dropped out before",
        }.get(self.state, f"nobody has cleared it, in {mode}")

    def on(self, event: Event) -> None:
        """Take an event."""
        before = self.state
        custody = next_custody(before, event)
        if custody is before:
            return
        self.record = replace(self.record, custody=custody)
        if custody not in AIRBORNE:
            self.record = replace(self.record, mode="", ordered=())
        elif before not in AIRBORNE:
            launched = self.record.launched or event is Event.LIFT_OFF
            self.record = replace(self.record, mode=self.seen.mode, flown=True, launched=launched)
        if event is Event.CLEAR or (event is Event.COME_DOWN and before not in AIRBORNE):
            self.authority += 1
            self._cleared_number = self._number
        if event is not Event.LIFT_OFF:
            self._changed()
        ended = before in AIRBORNE and custody not in AIRBORNE
        if ended and self.search is not None and self.record.search != self.search:
            self._join(self.search)

    def lose(self, why: str) -> None:
        """Continue the search without this vehicle, unless it has nothing left to do there."""
        if not self.is_out and self.record.search == self.search:
            self.record = replace(self.record, lost=why)

    def drop_out(self, why: str) -> None:
        """Stop following the drone."""
        self.lose(why)
        self.on(Event.DROP_OUT)

    def replace_vehicle(self, record: FlightRecord) -> None:
        """Take the record of another vehicle that has turned out to be connected."""
        self.record, self.seen, self.over = record, VehicleState(), False
        self._cleared_number, self._was_armed = self._number, False
        self._failsafe_since_s, self._explained_until_s = math.inf, -math.inf
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
            self.on(Event.SEARCH_OVER)
        if not self.airborne:
            self._join(search)

    def leave(self) -> None:
        """Follow no search."""
        self.search = None
        self.on(Event.SEARCH_OVER)

    def _join(self, search: SearchId) -> None:
        self.record = replace(
            self.record, search=search, top_amsl_m=self.top_amsl_m, flown=False, lost="",
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
        if seen.flying or seen.armed:
            self.lose(self.holder)
            return Rejected("in_the_air", f"in the air, {self.holder}: clear it once it is down")
        # The operator has seen its mode, so the bridge may change that mode.
        self._clear(now_s, arm=True, modes=(seen.mode,))
        later = self.record.search is None
        return Accepted("cleared for the next search" if later else "cleared to fly")

    def _clear(self, now_s: float, *, arm: bool, modes: Iterable[str] = ()) -> None:
        self.on(Event.CLEAR)
        # If the search is over for it, the clearance is for the next one.
        search = None if self.over else self.search
        self._cleared_s = now_s
        self.record = replace(
            self.record, search=search, top_amsl_m=self.top_amsl_m, lost="", arm=arm,
            from_modes=tuple(modes), looked=-1,
        )  # fmt: skip

    def _clear_in_the_air(self, *, search_alive: bool) -> Result[str]:
        if self._as_mission:
            why = "in the air, and its mission does not go on: clear it once it is down"
            return Rejected("in_the_air", why)
        if self.is_out or not search_alive:
            comes_down = self.state is Custody.RECALLED
            return Rejected("no_search", _COMING_DOWN if comes_down else _NO_SEARCH)
        self.on(Event.CLEAR)
        if self.search is not None and self.record.search != self.search:
            self._join(self.search)
        self.record = replace(self.record, flown=True, from_modes=())
        return Accepted("cleared to fly")

    def lapse(self, now_s: float) -> None:
        """End a clearance for a search to come if none has come."""
        waits = self.state is Custody.CLEARED and self.record.search is None
        if waits and now_s - self._cleared_s > CONSENT_S:
            self.on(Event.SEARCH_OVER)

    def clear_automatically(self, now_s: float) -> None:
        """Clear it according to the parameter `arm`, if that applies to this search."""
        seen, custody, always = self.seen, self.state, self._arm == "always"
        if not self._automatic or seen.unfit or not seen.connected or self.is_out:
            return
        flown = self.record.flown and self.record.search == self.search
        if custody is Custody.FREE or (always and custody is Custody.GROUNDED and not flown):
            on_the_ground = not (seen.armed or seen.flying)
            self._automatic = always and not on_the_ground
            if on_the_ground:
                modes = sorted(self._autopilot.landed_modes) if always else ()
                self._clear(now_s, arm=self._arm != "false", modes=modes)
        elif custody is Custody.CLEARED:
            self._automatic = False
            self.record = replace(self.record, arm=self.record.arm or self._arm != "false")
        elif always and custody in (Custody.RELEASED, Custody.ENDING):
            self._automatic = False
            self._clear_in_the_air(search_alive=True)
        elif always and custody in (Custody.TAKEN, Custody.FAILSAFE):
            self._automatic = custody is Custody.FAILSAFE
            self.lose(self.holder)
        elif always and custody in (Custody.HELD, Custody.RECALLED):
            # It was not free when the search began, so this search cannot clear it later.
            self._automatic = False

    def ground(self) -> Result[str]:
        """Keep it on the ground for an operator; returns what was done, or why not."""
        if self.airborne or self.seen.flying:
            return Rejected("in_the_air", "in the air: hold it, or have it return or land")
        self.lose("kept on the ground by the operator")
        self.on(Event.GROUND)
        return Accepted(_KEPT)

    def operate(self, what: str) -> Result[str]:
        """Make it `hold`, `return` or `land`; returns what was done, or why not.

        A vehicle that the bridge has launched always comes down, no matter who controls it.
        """
        if self.state is Custody.CLEARED and self.seen.armed:
            self.on(Event.LIFT_OFF)
        in_the_air = self.seen.armed or self.seen.flying
        comes_down = what != "hold" and self.record.launched and in_the_air
        if not (self.airborne or comes_down):
            if in_the_air or self.state in (Custody.TAKEN, *_ENDS_ON_THE_GROUND):
                return Rejected("taken", self.holder)
            return self.ground()
        if what == "hold":
            self.on(Event.HOLD)
            return Accepted("ordered to hold")
        self._recall(what, f"recalled by the operator: {what}", Event.COME_DOWN)
        return Accepted(_CIRCLES if self._autopilot.circles else f"ordered to {what}")

    def _recall(self, end: str, why: str, event: Event) -> None:
        """Make it `return` or `land`, even from a mode that somebody else has set."""
        self.lose(why)
        if end != self.record.end:
            self._changed()
        modes = () if self.airborne else (self.seen.mode,)
        self.on(event)
        self.record = replace(self.record, end=end, from_modes=modes)

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
        before, self.seen = self.seen, state
        if state.identity.restarts > before.identity.restarts and self.state is not Custody.FREE:
            self.lose("taken over: its autopilot was restarted")
            self.on(Event.TAKE_OVER)
        self._observe_outcome(state, outcome)
        self._explain(state)
        if state.connected and state.mode:
            self._observe_foreign_acts(before, state, outcome)
            self._observe_mode(before, state)
            if outcome.order is None:
                self._observe_without_order(state)
            self._observe_motors(state, outcome)
            if self.airborne and is_ours(self.record, state, self._autopilot):
                self.record = replace(self.record, mode=state.mode)
        self._observe_failsafe(state, outcome, now_s)

    def _observe_outcome(self, state: VehicleState, outcome: Outcome) -> None:
        """Take what the controller has seen under an order."""
        ended = outcome.status in ("taken_over", "failsafe")
        self._number = outcome.number if ended else outcome.number - 1
        # A clearance takes earlier ends of orders into account, but not how an order that is still
        # under way will end.
        ours = self.airborne or self.state is Custody.CLEARED
        if ours and outcome.number > self._cleared_number:
            if outcome.status == "taken_over":
                self._take_over(outcome.reason, state)
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
        if not concerns or state.failsafe in _CONTINUES:
            self._failsafe_since_s = math.inf
            return
        self._failsafe_since_s = min(self._failsafe_since_s, now_s)
        # A critical state without a reason may become a named failsafe.
        certain = state.failsafe != "critical" and (ordered or acts)
        if certain or now_s - self._failsafe_since_s >= FAILSAFE_S:
            self._fail(state, Event.DROP_OUT if ordered and not acts else Event.FAILSAFE)

    def _fail(self, state: VehicleState, event: Event) -> None:
        self.lose(f"{state.failsafe or 'critical'} failsafe")
        self.on(event)

    def _take_over(self, what: str, state: VehicleState) -> None:
        self.lose(f"taken over: {what}")
        self.on(Event.TAKE_OVER)
        foreign = state.flying and state.mode not in self._autopilot.take_off_modes
        self._explained_until_s = state.heard_s + _EXPLAINED_S if foreign else -math.inf

    def _explain(self, state: VehicleState) -> None:
        """Recognise the failsafe that has taken it away, reported after its effect."""
        if state.failsafe in ("", "critical", "offboard"):
            return
        explains = state.heard_s < self._explained_until_s
        if explains:
            self._explained_until_s = -math.inf
            self.on(Event.EXPLAIN)
        if self.record.lost and (explains or self.record.lost == _UNNAMED):
            self.record = replace(self.record, lost=f"{state.failsafe} failsafe")

    def _observe_foreign_acts(
        self, before: VehicleState, state: VehicleState, outcome: Outcome
    ) -> None:
        """Recognise that somebody else has changed what a vehicle in the air flies."""
        if not (self.airborne and state.flying):
            return
        act = foreign_act(self.record, before, state)
        if act:
            self._take_over(act, state)
            # What that person has set is no act against a later order of an operator.
            self.record = replace(self.record, home=state.home, items=0)
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

    def _observe_mode(self, before: VehicleState, state: VehicleState) -> None:
        autopilot = self._autopilot
        guided_mode = autopilot.guided_mode
        on_the_ground = not (before.armed or state.armed) and bool(before.mode)
        usual_modes = autopilot.boot_modes | autopilot.orderly_modes
        if on_the_ground and before.mode != state.mode and state.mode not in usual_modes:
            self._take_over(f"in {state.mode}", state)
        if before.armed and state.armed and before.mode != guided_mode == state.mode:
            self.on(Event.RELEASE)
        if self.state is Custody.RELEASED and state.mode not in autopilot.orderly_modes:
            self.on(Event.FAILSAFE if state.failsafe else Event.TAKE_OVER)

    def _observe_motors(self, state: VehicleState, outcome: Outcome) -> None:
        cleared = self.state is Custody.CLEARED
        takes_off = cleared and isinstance(outcome.order, TakeOff | FlyMission)
        if state.armed or state.flying:
            self._was_armed |= state.armed
            self._observe_running_motors(state, takes_off=takes_off)
            return
        may_be_a_doubles = self._was_armed and state.disarmed_beats < _DISARMED_BEATS
        if may_be_a_doubles or state.identity.twins:
            return
        if self.airborne or self.state in _ENDS_ON_THE_GROUND or self._was_armed:
            if self.state is Custody.FOLLOWING and not self._as_mission:
                self.lose("on the ground again before the end of the search")
            self.on(Event.DOWN)
        if self._was_armed or not takes_off:
            self.record = replace(self.record, launched=False, home=None, items=0)
        self._was_armed = False

    def _observe_running_motors(self, state: VehicleState, *, takes_off: bool) -> None:
        if self.state is not Custody.CLEARED:
            return
        autopilot = self._autopilot
        modes = autopilot.take_off_modes
        if self._as_mission:
            modes |= autopilot.mission_modes
        if takes_off and state.mode in modes:
            self.on(Event.LIFT_OFF)
        elif self.record.arm or state.flying or state.mode not in modes:
            self._take_over(f"armed by somebody else, in {state.mode}", state)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Custody of one vehicle, from what it reports, from searches and from persons.

This module recognises the events of `custody`. The `FlightRecord` outlasts the program.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

from dsse_ros.bridge.custody import AIRBORNE, Custody, Event, next_custody
from dsse_ros.flight.autopilots import Autopilot
from dsse_ros.flight.orders import Land, Return, TakeOff
from dsse_ros.flight.vehicle_controller import Outcome
from dsse_ros.flight.vehicle_state import VehicleState

SearchId = tuple[int, int]
"""run_id and mission."""
Arm = Literal["false", "true", "always"]
"""Which searches clear a vehicle: the first one, and a person arms it (`false`) or the bridge does
(`true`), or each one (`always`)."""


@dataclass(frozen=True)
class FlightRecord:
    """The state of a vehicle that a restarted bridge needs.

    Attributes:
        custody: Who has it.
        search: The search that the record belongs to; None for the next one.
        flown: Whether it has been in the air for that search.
        lost: Why it no longer follows its drone in that search; empty if it does.
        arm: While it is cleared, whether the bridge may arm it.
        modes: While it is cleared, modes that the bridge may change on the ground: see `TakeOff`.
        end: While it is recalled, `return` or `land`.
        mode: While the bridge flies it, the last reported mode.
        alt_m: Altitude above home to which it takes off for that search.
        arming_s: While it is cleared, when it was ordered to arm and take off, on the machine's
            steady clock; 0 if it was not.
    """

    custody: Custody = Custody.FREE
    search: SearchId | None = None
    flown: bool = False
    lost: str = ""
    arm: bool = False
    modes: tuple[str, ...] = ()
    end: str = ""
    mode: str = ""
    alt_m: float = 0.0
    arming_s: float = 0.0


COMING_DOWN: Mapping[str, str] = {"return": "RTL", "land": "LAND"}
"""Modes in which a vehicle comes down by itself, by the operator's command."""
_ENDS_ON_THE_GROUND = (Custody.FAILSAFE, Custody.RELEASED)
CONTINUES = ("", "offboard", "radio", "gcs")
"""Failsafes after which the bridge goes on with an autopilot that stays in its mode, or brings it
back to that mode."""
FOREIGN_S = 5.0
"""How long a vehicle without an order may be in a mode that does not fit its state."""
SELF_DISARMING_S = 8.0
"""Time for which an autopilot on the ground does not disarm itself: ArduCopter's DISARM_DELAY and
PX4's COM_DISARM_PRFLT are 10 s."""
RISEN_M = 3.0
"""Distance below its take-off altitude from which a vehicle counts as having taken off."""


class VehicleCustody:
    """Recognises the events of a vehicle, and keeps its record.

    Args:
        autopilot: Autopilot of the vehicle.
        arm: See `Arm`.
        record: Its record so far.
        at_end: What it does when its search is over: `return`, `land` or `hold`.
        whole: Whether the vehicle flies searches as missions, which land by themselves.
        changed: Called after each change of state except lift-off: earlier orders are void.

    Attributes:
        record: What a restarted program must know about the vehicle.
        authority: Number of its latest clearance: see `VehicleController.give`.
        search: The followed search; None for none.
        over: Whether this vehicle has nothing left to do in that search.
        alt_m: Altitude above home to which it takes off in that search.
        seen: State that the vehicle reported last.
    """

    def __init__(
        self,
        autopilot: Autopilot,
        arm: Arm,
        record: FlightRecord,
        changed: Callable[[], None],
        *,
        at_end: str = "return",
        whole: bool = False,
    ) -> None:
        self._autopilot = autopilot
        self._at_end = at_end
        self._arm = arm
        self.record = record
        self._changed = changed
        self._whole = whole
        self.authority = 0
        self.search: SearchId | None = None
        self.over = False
        self.alt_m = 0.0
        self.seen = VehicleState()
        self._automatic = False
        self._inherited = record.custody
        self._left_arming_s = record.arming_s
        # Whether it is armed for a take-off that an earlier program may not have commanded.
        self._idles = False
        # The highest number of an order for which it is known whether somebody else has ended it,
        # now and at the latest clearance.
        self._number = self._cleared_number = 0
        self._foreign_since_s: float | None = None

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
        mode = self.seen.mode or "no known mode"
        return {
            Custody.TAKEN: f"a person has it, in {mode}",
            Custody.FAILSAFE: f"a failsafe has it, in {mode}",
            Custody.RELEASED: f"a person has released it, in {mode}",
            Custody.GROUNDED: "it has flown or dropped out before",
        }.get(self.state, f"nobody has cleared it, in {mode}")

    def on(self, event: Event) -> None:
        """Take an event."""
        before = self.state
        custody = next_custody(before, event)
        if custody is before:
            return
        self.record = replace(self.record, custody=custody)
        if event is Event.CLEAR:
            self.authority += 1
            self._cleared_number = self._number
        if event is Event.LIFT_OFF:
            self.record = replace(self.record, flown=True)
        else:
            self._changed()
        ended = before in AIRBORNE and custody not in AIRBORNE
        if ended and self.search is not None and self.record.search != self.search:
            self._join(self.search)

    def lose(self, why: str) -> None:
        """Continue the search without this vehicle, unless it has nothing left to do there."""
        if not self.is_out and self.record.search == self.search:
            self.record = replace(self.record, lost=why)

    # Searches

    def begin(self, search: SearchId, alt_m: float, *, first: bool) -> None:
        """Follow a search; with `first`, the first of this program, it may clear the vehicle."""
        self.search, self.alt_m, self.over = search, alt_m, False
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
        self.record = replace(self.record, search=search, alt_m=self.alt_m, flown=False, lost="")

    # Persons

    def clear(self, *, alone: bool = False) -> str:
        """Clear it to fly for an operator; returns why not, empty if it is cleared.

        Args:
            alone: Whether the operator has cleared this vehicle alone, not the whole fleet.
        """
        custody, seen = self.state, self.seen
        released = custody is Custody.RELEASED and alone and not self.is_out
        if custody in (Custody.HELD, Custody.RECALLED) or released:
            if self._whole:
                return "in the air, and its mission does not go on: clear it once it is down"
            self._clear_in_the_air()
            return ""
        if custody is Custody.FOLLOWING:
            return ""
        if seen.problem or not seen.mode:
            return seen.problem or "no heartbeat"
        if custody is Custody.ENDING or seen.flying or seen.armed:
            if custody is Custody.ENDING:
                return "coming down: clear it once it is down"
            self.lose(self.holder)
            return f"in the air, {self.holder}: clear it once it is down"
        # The operator has seen its mode, so the bridge may change that mode.
        self._clear(arm=True, modes=(seen.mode,))
        return ""

    def _clear(self, *, arm: bool, modes: Iterable[str] = ()) -> None:
        self.on(Event.CLEAR)
        # If the search is over for it, the clearance is for the next one.
        search = None if self.over else self.search
        self.record = replace(
            self.record, search=search, alt_m=self.alt_m, lost="", arm=arm, modes=tuple(modes)
        )

    def _clear_in_the_air(self) -> None:
        out = self.is_out
        self.on(Event.CLEAR)
        if out:
            self.on(Event.SEARCH_OVER)
        elif self.search is not None and self.record.search != self.search:
            self._join(self.search)
        self.record = replace(self.record, flown=True)

    def clear_automatically(self) -> None:
        """Clear it according to the parameter `arm`, if that applies to this search."""
        seen, custody, always = self.seen, self.state, self._arm == "always"
        if not self._automatic or not seen.connected or seen.problem or self.is_out:
            return
        flown = self.record.flown and self.record.search == self.search
        if custody is Custody.FREE or (always and custody is Custody.GROUNDED and not flown):
            on_the_ground = not (seen.armed or seen.flying)
            self._automatic = always and not on_the_ground
            if on_the_ground:
                modes = sorted(self._autopilot.landed_modes) if always else ()
                self._clear(arm=self._arm != "false", modes=modes)
        elif custody is Custody.CLEARED:
            self._automatic = False
            self.record = replace(self.record, arm=self.record.arm or self._arm != "false")
        elif always and custody in (Custody.RELEASED, Custody.ENDING):
            self._automatic = False
            self._clear_in_the_air()
        elif always and custody in (Custody.TAKEN, Custody.FAILSAFE):
            self._automatic = custody is Custody.FAILSAFE
            self.lose(self.holder)
        elif always and custody in (Custody.HELD, Custody.RECALLED):
            # It was not free when the search began, so this search cannot clear it later.
            self._automatic = False

    def ground(self) -> str:
        """Keep it on the ground for an operator; returns why not, empty if it stays."""
        if self.airborne or self.seen.flying:
            return "in the air: hold it, or have it return or land"
        self.lose("kept on the ground by the operator")
        self.on(Event.GROUND)
        return ""

    def operate(self, what: str) -> str:
        """Make it `hold`, `return` or `land`; returns why not, empty if it does."""
        if self.state in (Custody.TAKEN, Custody.FAILSAFE, Custody.RELEASED):
            return self.holder
        if self.state is Custody.CLEARED and self.seen.armed:
            self.on(Event.LIFT_OFF)
        if not self.airborne:
            self.lose("kept on the ground by the operator")
            self.on(Event.HOLD)
            return ""
        if what == "hold":
            self.on(Event.HOLD)
            return ""
        self.lose(f"recalled by the operator: {what}")
        if what != self.record.end:
            self._changed()
        self.on(Event.COME_DOWN)
        self.record = replace(self.record, end=what)
        return ""

    # The vehicle

    def observe(self, state: VehicleState, outcome: Outcome, *, takes_off: bool) -> None:
        """Recognise who controls the vehicle.

        Args:
            state: Its reported state.
            outcome: Outcome of the last order.
            takes_off: Whether it was ordered to take off.
        """
        before, self.seen = self.seen, state
        ended = outcome.status in ("taken_over", "failsafe")
        self._number = outcome.number if ended else outcome.number - 1
        # A clearance takes earlier ends of orders into account, but not how an order that is still
        # under way will end.
        ours = self.airborne or self.state is Custody.CLEARED
        if ours and outcome.number > self._cleared_number:
            if outcome.status == "taken_over":
                self.lose(f"taken over: {outcome.reason}")
                self.on(Event.TAKE_OVER)
            elif outcome.status == "failsafe":
                self.lose(f"{state.failsafe or 'critical'} failsafe")
                self.on(Event.FAILSAFE)
        self._observe_without_order(state, outcome)
        named = state.failsafe not in ("", "critical", "offboard")
        if named and self.record.lost == "critical failsafe":
            # The autopilot reports the cause of the failsafe after its effect.
            self.record = replace(self.record, lost=f"{state.failsafe} failsafe")
        if state.connected and state.mode:
            ordered = outcome.order is not None or not self.airborne
            known = ordered or self._observe_since_record(state)
            self._observe_mode(before, state)
            self._observe_left_arming(state)
            self._observe_motors(before, state, takes_off=takes_off)
            if self.record.arming_s and not (takes_off and self.state is Custody.CLEARED):
                self.record = replace(self.record, arming_s=0.0)
            mode = state.mode if self.airborne else ""
            # Do not record a mode that somebody else has set before it is known who has.
            ours = not mode or (known and self._is_ours(mode, outcome))
            if ours and mode != self.record.mode:
                self.record = replace(self.record, mode=mode)

    def _is_ours(self, mode: str, outcome: Outcome) -> bool:
        """Return whether an order of the bridge may have caused a mode."""
        autopilot, order = self._autopilot, outcome.order
        if self._whole:
            return order is not None or mode in autopilot.mission_modes
        climbs = isinstance(order, TakeOff) and outcome.status != "done"
        if self.record.mode == autopilot.take_off_mode:
            climbs |= self.seen.alt_m < self.record.alt_m - RISEN_M
        if climbs and autopilot.take_off_mode and mode == autopilot.resting_mode:
            # Before the top of the climb, only a person can have set this mode.
            return False
        coming_down: Collection[str] = ()
        if isinstance(order, Return | Land):
            coming_down = ["RTL" if isinstance(order, Return) else "LAND"]
        elif order is None and self.state in (Custody.ENDING, Custody.RECALLED):
            # An earlier program may have given the order.
            coming_down = COMING_DOWN.values()
        before = () if self.record.mode in coming_down else autopilot.take_off_modes
        return mode in coming_down or mode in before

    def _observe_without_order(self, state: VehicleState, outcome: Outcome) -> None:
        """Recognise that somebody else has a vehicle that an earlier program flew."""
        usual = self._autopilot.take_off_modes
        going = self.state is Custody.FOLLOWING and self._whole
        if going and self.record.mode in self._autopilot.mission_modes:
            # It has begun its mission, which goes on without the bridge.
            usual = self._autopilot.mission_modes
        elif self.state in (Custody.ENDING, Custody.RECALLED) or self._whole:
            usual |= self._autopilot.landed_modes
        ordered = outcome.order is not None or not (self.airborne and state.connected)
        orderly = state.mode in usual and state.failsafe in CONTINUES
        if ordered or orderly or not (state.armed or state.flying):
            self._foreign_since_s = None
            return
        if self._foreign_since_s is None:
            self._foreign_since_s = state.heard_s
        if state.heard_s - self._foreign_since_s >= FOREIGN_S:
            self._lose_to_others(state)

    def _lose_to_others(self, state: VehicleState) -> None:
        failsafe = state.failsafe
        self.lose(f"{failsafe} failsafe" if failsafe else f"taken over: in {state.mode}")
        self.on(Event.FAILSAFE if failsafe else Event.TAKE_OVER)

    def _observe_since_record(self, state: VehicleState) -> bool:
        """Recognise that somebody else has changed the mode since an earlier program recorded it.

        Returns:
            Whether that can be decided already.
        """
        autopilot, record = self._autopilot, self.record
        if self._whole or not state.armed or record.mode in ("", state.mode):
            return True
        brought_about: frozenset[str] = autopilot.orderly_modes
        going = record.mode in autopilot.take_off_modes - {autopilot.resting_mode}
        if going and state.failsafe:
            # After missed setpoints the vehicle may have left the guided mode for any of these.
            brought_about |= autopilot.setpoint_loss_modes
        elif self._inherited is Custody.FOLLOWING and not going:
            # The vehicle was armed for its take-off, so the take-off can have changed the mode.
            brought_about |= autopilot.take_off_modes
        elif record.mode == autopilot.guided_mode and not self._holds:
            brought_about = frozenset({autopilot.guided_mode})
        # The record of the earlier program shows which order it gave.
        if self._inherited is Custody.RECALLED:
            ordered = {COMING_DOWN[record.end or "return"]}
            brought_about = brought_about | ordered if going else frozenset(ordered)
        elif self._inherited is Custody.ENDING:
            comes_down = record.mode in COMING_DOWN.values()
            brought_about |= {COMING_DOWN.get(self._at_end, record.mode)}
            brought_about = frozenset() if comes_down else brought_about
        elif self._inherited is Custody.HELD and not going:
            brought_about = frozenset({autopilot.resting_mode})
        if record.mode == autopilot.take_off_mode and state.mode == autopilot.resting_mode:
            if not state.has_position:
                return False
            if state.alt_m < record.alt_m - RISEN_M:
                brought_about = frozenset()
        if state.mode not in brought_about:
            self._lose_to_others(state)
        return True

    @property
    def _holds(self) -> bool:
        """Whether an earlier program may have ordered it to hold."""
        at_end = self._inherited is Custody.ENDING and self._at_end == "hold"
        return at_end or self._inherited is Custody.HELD

    def rest(self) -> None:
        """Record, as the program ends, that it is ordered to hold."""
        if self.state is Custody.FOLLOWING and self.record.mode == self._autopilot.guided_mode:
            self.record = replace(self.record, mode=self._autopilot.resting_mode)

    def _observe_mode(self, before: VehicleState, state: VehicleState) -> None:
        autopilot = self._autopilot
        guided_mode = autopilot.guided_mode
        on_the_ground = not (before.armed or state.armed) and bool(before.mode)
        usual_modes = autopilot.boot_modes | autopilot.orderly_modes
        if on_the_ground and before.mode != state.mode and state.mode not in usual_modes:
            self.lose(f"taken over: in {state.mode}")
            self.on(Event.TAKE_OVER)
        if before.armed and state.armed and before.mode != guided_mode == state.mode:
            self.on(Event.RELEASE)
        if self.state is Custody.RELEASED and state.mode not in autopilot.orderly_modes:
            self.on(Event.FAILSAFE if state.failsafe else Event.TAKE_OVER)

    def begin_arming(self, now_s: float) -> None:
        """Record that it is about to be ordered to arm and take off."""
        self.record = replace(self.record, arming_s=now_s)

    def _observe_left_arming(self, state: VehicleState) -> None:
        """Recognise the outcome for a vehicle that an earlier program ordered to arm at its end."""
        left_s, self._left_arming_s = self._left_arming_s, 0.0
        if not left_s or self.state is not Custody.CLEARED:
            return
        if not state.armed:
            # Nobody knows who disarmed it.
            self.lose("disarmed while no bridge was there")
            self.on(Event.TAKE_OVER)
        elif (
            # After this time it would have disarmed itself, so somebody else must have armed it.
            0.0 <= state.heard_s - left_s < SELF_DISARMING_S
            and state.mode in self._autopilot.take_off_modes
        ):
            self.on(Event.LIFT_OFF)
            self._idles = True

    def _observe_motors(
        self, before: VehicleState, state: VehicleState, *, takes_off: bool
    ) -> None:
        self._idles = self._idles and not state.flying
        if state.armed or state.flying:
            if self.state is Custody.CLEARED and takes_off:
                self.on(Event.LIFT_OFF)
            elif self.state is Custody.CLEARED and (self.record.arm or state.flying):
                self.lose(f"taken over: armed by somebody else, in {state.mode}")
                self.on(Event.TAKE_OVER)
        elif self.airborne or self.state in _ENDS_ON_THE_GROUND or before.armed:
            if self.state is Custody.FOLLOWING and not self._whole:
                self.lose("on the ground again before the end of the search")
            # Nobody knows whether an idling vehicle disarmed itself or a person did.
            self.on(Event.TAKE_OVER if self._idles else Event.DOWN)
            self._idles = False

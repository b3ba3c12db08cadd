# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Chooses the next order of a drone's vehicle, without ROS, links and clocks.

`VehicleCustody` decides who controls the vehicle and which orders are allowed; this module decides
which order is wanted.
"""

from __future__ import annotations

import math
from dataclasses import replace

from dsse_ros.bridge.clearance import Clearance
from dsse_ros.bridge.custody import MAY_ORDER, Custody, Event
from dsse_ros.bridge.fence import Fence, check_take_off
from dsse_ros.bridge.tasks import Task
from dsse_ros.bridge.vehicle_custody import (
    COMING_DOWN,
    CONTINUES,
    RISEN_M,
    Arm,
    FlightRecord,
    SearchId,
    VehicleCustody,
)
from dsse_ros.flight.autopilots import Autopilot
from dsse_ros.flight.orders import (
    FlyMission,
    Hold,
    Land,
    MakeReady,
    Return,
    Search,
    TakeOff,
)
from dsse_ros.flight.setpoints import offset_m
from dsse_ros.flight.vehicle_controller import Order, Outcome
from dsse_ros.flight.vehicle_state import VehicleState
from msg_adapters.result import Accepted, Rejected, Result
from msg_adapters.track_missions import Leg

TRIES = 3
"""How often a failing order is given."""
RETRY_S = 5.0
CRITICAL_S = 5.0
"""Time in which an autopilot that is critical without giving a reason may recover."""

_OVER_HOME_M = 15.0
_ENDS: dict[str, Order] = {"return": Return(), "land": Land(), "hold": Hold()}


class VehicleFollower:
    """Makes one vehicle follow its drone along its legs, one order at a time.

    Args:
        autopilot: Autopilot of the vehicle.
        at_end: What it does when its drone's search is over: return, land or hold.
        join_timeout_s: Time in which it must be able to take off.
        lost_timeout_s: Time without a heartbeat after which it is lost.
        arm: Which searches clear it.
        whole: Whether it flies the search as one mission, once the search is over.
        record: Its record so far.

    Attributes:
        custody: Who has it.
        leg: The current leg, None before the first step.
        arrived: Whether it has done all of the leg.
        refused: Why the task, or the take-off, is refused; empty if it is not.
        blocked: What keeps it from doing what it should; empty if nothing does.
        ready: Whether it could take off now if the other vehicles allow it.
        risen: Whether it has been at its altitude in this search.
        finished: Whether it has nothing left to do in this search.
        leaves_layer: Why it would leave its layer to return by itself; empty if it would not.
    """

    def __init__(
        self,
        autopilot: Autopilot,
        at_end: str,
        join_timeout_s: float,
        lost_timeout_s: float,
        *,
        arm: Arm = "false",
        whole: bool = False,
        record: FlightRecord | None = None,
    ) -> None:
        self._acts_when_critical = autopilot.acts_when_critical
        self._mission_mode = autopilot.mission_mode
        self._at_end = at_end
        self._join_timeout_s = join_timeout_s
        self._lost_timeout_s = lost_timeout_s
        self._whole = whole
        self._take_off_alt_m = 0.0
        self._fence: Fence | None = None
        self.leaves_layer = ""
        self._forget_search()
        self.custody = VehicleCustody(
            autopilot,
            arm,
            record or FlightRecord(),
            self._forget_order,
            at_end=at_end,
            whole=whole,
        )

    def _forget_search(self) -> None:
        self.leg: Leg | None = None
        self.arrived = False
        self.refused = ""
        self.blocked = ""
        self.ready = False
        self.risen = False
        self.finished = False
        self._task: Task | None = None
        self._holding = False
        # Whether the search was already over at the first leg; None before that.
        self._late: bool | None = None
        self._blocked_since_s: float | None = None
        self._forget_order()

    def _forget_order(self) -> None:
        # The last order, and what it was given for: the wanted order, and the stamp of its leg if
        # each leg needs the order again.
        self._given: Order | None = None
        self._given_for: tuple[Order, int] | None = None
        self._done = False
        self._tries = 0
        self._failed_s: float | None = None
        self._critical_since_s: float | None = None

    # The search

    def begin(
        self, search: SearchId, take_off_alt_m: float, fence: Fence, *, first: bool = False
    ) -> None:
        """Follow a search.

        Args:
            search: The search.
            take_off_alt_m: Altitude above home to take off to.
            fence: Where the vehicle may be, and take off.
            first: Whether it is the first search of this program, for which the parameter `arm`
                may clear the vehicle.
        """
        self._forget_search()
        self._take_off_alt_m, self._fence = take_off_alt_m, fence
        self.custody.begin(search, take_off_alt_m, first=first)

    def leave(self) -> None:
        """Follow no search: a search that cannot be flown is over."""
        self._forget_search()
        self.custody.leave()

    def follow(self, leg: Leg, task: Result[Task] | None) -> None:
        """Replace the leg and its task.

        Args:
            leg: The leg.
            task: The task, or why the vehicle may not do it; None if it is not known yet.
        """
        before = self.leg
        known = self.has_task or task is None
        if before and known and (leg.stamp_ns, leg.cell) == (before.stamp_ns, before.cell):
            # The step was reported again: only the end of the search may be new.
            self.leg = leg
            return
        self.leg, self._holding, self.arrived = leg, False, False
        self._task = task.value if isinstance(task, Accepted) else None
        self.refused = task.reason if isinstance(task, Rejected) else ""
        if self._late is None:
            self._late = leg.over and not self._whole

    def hold(self) -> None:
        """Hold until the next leg."""
        self._holding = True

    def drop_out(self, why: str) -> None:
        """Stop following the drone."""
        self.custody.lose(why)
        self.custody.on(Event.DROP_OUT)

    @property
    def lost(self) -> str:
        """Why the vehicle no longer follows its drone; empty if it does."""
        return self.custody.lost

    @property
    def arrived_stamp_ns(self) -> int:
        """Stamp of the leg if the vehicle has done all of it; else -1."""
        return self.leg.stamp_ns if self.leg is not None and self.arrived else -1

    @property
    def waiting(self) -> bool:
        """Whether it has nothing to do until the next step."""
        return self.leg is None or self.arrived or self.leg.over or bool(self.lost or self.refused)

    @property
    def has_task(self) -> bool:
        """Whether the task for the leg is known, even if it is refused."""
        return self._task is not None or bool(self.refused)

    @property
    def mission_under_way(self) -> bool:
        """Whether it flies its search as a mission."""
        return self._whole and self.custody.state is Custody.FOLLOWING and not self.arrived

    @property
    def holds_up(self) -> bool:
        """Whether it still has to take off, but cannot now."""
        return self.is_awaited and not self.ready

    @property
    def takes_off(self) -> bool:
        """Whether it was ordered to take off, and is on the ground."""
        ordered = isinstance(self._given, TakeOff | FlyMission)
        return ordered and self.custody.state is Custody.CLEARED

    @property
    def given(self) -> Order | None:
        """The last order; None if there is none, or it is void."""
        return self._given

    @property
    def under_way(self) -> Order | None:
        """The order that it is carrying out; None if it has done it, or has none."""
        return None if self._done else self._given

    @property
    def is_awaited(self) -> bool:
        """Whether it should take off for the followed search."""
        custody = self.custody
        return self.leg is not None and not custody.airborne and not custody.is_out

    # Time

    def advance(
        self,
        state: VehicleState,
        outcome: Outcome,
        now_s: float,
        trouble: str = "",
        clearance: Clearance | None = None,
    ) -> Order | None:
        """Return the order to give now, None if there is no new one.

        Args:
            state: State that the vehicle reports.
            outcome: Outcome of the last order.
            now_s: Time on a steady clock, the one of `state.heard_s`.
            trouble: What is wrong with its link; empty if nothing is.
            clearance: What the other vehicles and the search allow it to do.
        """
        clearance = clearance or Clearance()
        self._look(outcome, now_s)
        self._set_over()
        self.custody.observe(state, outcome, takes_off=self.takes_off)
        self._watch(state, now_s, trouble)
        self.custody.clear_automatically()
        self._await_take_off(state, outcome, now_s, trouble, clearance)
        self.finished = self._is_finished(state)
        return self._next_order(state, now_s, clearance) if state.connected else None

    def _look(self, outcome: Outcome, now_s: float) -> None:
        """Handle the outcome of the order."""
        if self._given is None or outcome.order != self._given:
            return
        self._done = outcome.status == "done"
        if self._done and self._task is not None and self._given_for == self._stamped(self._task):
            self.arrived = True
        if outcome.status == "failed" and self._failed_s is None:
            self._failed_s = now_s
            # A mission that is started again would fly the whole search again.
            last = self._tries >= TRIES or outcome.final or isinstance(self._given, FlyMission)
            if last and not self.lost:
                self.drop_out(f"failed: {outcome.reason}")

    def _set_over(self) -> None:
        """Recognise whether this vehicle has nothing left to do in the search."""
        custody, leg = self.custody, self.leg
        if leg is None or not leg.over:
            custody.over = False
        elif self._whole:
            record = custody.record
            landed = record.flown and record.search == custody.search and not custody.airborne
            custody.over = self.arrived or landed
        else:
            nothing_left = self.arrived or self._task is None or leg.crashed or bool(self._late)
            custody.over = nothing_left or custody.state is not Custody.FOLLOWING

    def _watch(self, state: VehicleState, now_s: float, trouble: str) -> None:
        """Recognise whether the vehicle cannot follow its drone any further, or need not."""
        custody = self.custody
        self.risen |= state.has_position and state.alt_m > self._take_off_alt_m - RISEN_M
        if self.mission_under_way and self._waits_over_home(state):
            self.arrived = custody.over = True
        if custody.over and custody.record.search == custody.search:
            custody.on(Event.SEARCH_OVER)
        if not (custody.airborne or custody.state is Custody.CLEARED):
            return
        because = f": {trouble}" if trouble else ""
        silent = bool(state.mode) and not state.connected
        if state.problem:
            self.drop_out(state.problem)
        elif silent and now_s - state.heard_s >= self._lost_timeout_s and not self.lost:
            self.drop_out(f"link lost: no heartbeat for {self._lost_timeout_s:g} s{because}")
        elif self._has_failsafe(state, now_s):
            self.drop_out(f"{state.failsafe} failsafe")
            if self._acts_when_critical:
                custody.on(Event.FAILSAFE)

    def _has_failsafe(self, state: VehicleState, now_s: float) -> bool:
        """Return whether a failsafe, or a lasting critical state, ends following the drone."""
        certain = self._acts_when_critical and state.failsafe != "critical"
        if self._given is None and not (certain and self.custody.airborne):
            return False
        if state.failsafe != "critical":
            self._critical_since_s = None
            return state.failsafe not in CONTINUES
        # A critical state without a reason may become a named failsafe.
        if self._critical_since_s is None:
            self._critical_since_s = now_s
        return now_s - self._critical_since_s >= CRITICAL_S

    def _waits_over_home(self, state: VehicleState) -> bool:
        """Return whether it has flown its mission except for the landing."""
        task = self._task
        if not isinstance(task, FlyMission) or task.hold_item < 0 or not state.has_position:
            return False
        if state.mode != self._mission_mode:
            # The item stays the current one if a person ends the mission.
            return False
        item = task.items[task.hold_item]
        away = offset_m((state.lat_deg, state.lon_deg), (item.lat_deg, item.lon_deg))
        return state.item_current == task.hold_item and math.hypot(*away) <= _OVER_HOME_M

    def _is_finished(self, state: VehicleState) -> bool:
        if self.leg is None:
            return False
        if self.custody.airborne and state.connected:
            at_rest = self._given == _ENDS[self._at_end] and self._done
            return self.custody.state is Custody.ENDING and at_rest
        return self.custody.is_out

    # Before the take-off

    def _await_take_off(
        self,
        state: VehicleState,
        outcome: Outcome,
        now_s: float,
        trouble: str,
        clearance: Clearance,
    ) -> None:
        """Recognise what keeps it from taking off; drop out if that takes too long."""
        self.ready = False
        if not self.is_awaited:
            self.blocked, self._blocked_since_s = "", None
            return
        because = f": {trouble}" if trouble else ""
        what, why = self._reason_not_to_fly(state, outcome, because)
        self.blocked = what + why
        if what:
            if self._blocked_since_s is None:
                self._blocked_since_s = now_s
            if now_s - self._blocked_since_s > self._join_timeout_s:
                self.drop_out(f"{what} within {self._join_timeout_s:g} s{why}")
            return
        self._blocked_since_s = None
        self.ready = self.custody.state is Custody.CLEARED
        if not self.ready:
            # Waiting for a person has no timeout.
            in_the_air = state.flying or state.armed
            # In the air it is cleared alone.
            alone = self.custody.state is Custody.RELEASED and in_the_air and not self._whole
            clears = "drone<i>/arm clears it to fly" if alone else "~/arm clears it to fly"
            self.blocked = f"{self.custody.holder}: {clears}"
        elif clearance.take_off:
            self.blocked = clearance.take_off

    def _reason_not_to_fly(
        self, state: VehicleState, outcome: Outcome, because: str
    ) -> tuple[str, str]:
        """Return what keeps it from taking off, and why; empty if only a person does."""
        if not state.mode:
            return "no heartbeat", because
        if not state.connected:
            return "", ""
        if state.problem:
            return state.problem, ""
        because = because or (f": {state.unready}" if state.unready else "")
        if not state.has_position:
            return "no position", because
        if self._whole and not self.has_task:
            return "no home position", because
        if self.custody.state is not Custody.CLEARED or state.armed:
            return "", ""
        if not self._in_fence(state):
            return "no take-off", f": {self.refused}"
        # Readiness may depend on the mode, which `MakeReady` sets.
        prepared = self._done or not isinstance(self._given, MakeReady)
        if not (state.ready and prepared):
            waits = self._given is not None and outcome.reason
            return "not ready", f": {outcome.reason}" if waits else because
        return "", ""

    def _in_fence(self, state: VehicleState) -> bool:
        """Return whether it may take off from its position."""
        assert self._fence is not None
        place = (state.lat_deg, state.lon_deg)
        checked = check_take_off(*place, self._take_off_alt_m, self._fence)
        take_off = f"take-off: {checked.reason}" if isinstance(checked, Rejected) else ""
        if take_off or self.refused.startswith("take-off: "):
            self.refused = take_off
        return not take_off

    # Orders

    def _next_order(self, state: VehicleState, now_s: float, clearance: Clearance) -> Order | None:
        wanted = self._wanted(state, clearance)
        if wanted is None or not isinstance(wanted, MAY_ORDER[self.custody.state]):
            return None
        given_for, tries = self._stamped(wanted), 1
        if given_for == self._given_for:
            if self._failed_s is None or now_s - self._failed_s < RETRY_S:
                return None
            tries = self._tries + 1
        order = wanted
        # A vehicle that has dropped out, or was recalled, does not wait for others.
        if not self.lost and self.custody.state is not Custody.RECALLED:
            admitted = clearance.admit(wanted)
            if isinstance(admitted, str):
                self.blocked = admitted
                return None
            order = admitted
        self._given, self._given_for, self._tries = order, given_for, tries
        self._done, self._failed_s = False, None
        if isinstance(order, TakeOff | FlyMission) and order.arm and not state.armed:
            self.custody.begin_arming(now_s)
        return order

    def _stamped(self, order: Order) -> tuple[Order, int]:
        stamp_ns = self.leg.stamp_ns if self.leg and isinstance(order, Search) else 0
        return order, stamp_ns

    def _wanted(self, state: VehicleState, clearance: Clearance) -> Order | None:
        """Return what the vehicle should be doing, None where no order is needed."""
        match self.custody.state:
            case Custody.CLEARED:
                return self._wanted_on_the_ground(state, clearance)
            case Custody.FOLLOWING:
                return self._wanted_in_the_air(state)
            case Custody.HELD:
                return Hold()
            case Custody.RECALLED:
                return _ENDS[self.custody.record.end or "return"]
            case Custody.ENDING:
                return self._wanted_at_the_end(state, clearance)
        return None

    def _wanted_on_the_ground(self, state: VehicleState, clearance: Clearance) -> Order | None:
        if not self.is_awaited or not state.has_position:
            return None
        arm, modes = self.custody.record.arm, self.custody.record.modes
        refused = bool(self.refused) or not clearance.search_alive
        if refused or clearance.take_off or not (self.ready or self.takes_off):
            # This also cancels a take-off that has not begun.
            return MakeReady(arm, modes)
        if not self._whole:
            return TakeOff(self._take_off_alt_m, arm, modes)
        if isinstance(self._task, FlyMission):
            return replace(self._task, arm=arm, from_modes=modes)
        return None

    def _wanted_in_the_air(self, state: VehicleState) -> Order | None:
        custody = self.custody
        if self._whole or self.leg is None or custody.record.search != custody.search:
            # A mission ends by itself, and goes on without the bridge.
            return None
        if isinstance(self._given, TakeOff) and not self._done:
            # An order to fly somewhere would end the climb.
            return self._given
        if not state.flying:
            return None
        return Hold() if self._task is None or self._holding else self._task

    def _wanted_at_the_end(self, state: VehicleState, clearance: Clearance) -> Order | None:
        end, home = _ENDS["return" if self._whole else self._at_end], clearance.home
        # An earlier program may have begun the end.
        begun = self._given_for is not None and self._given_for[0] == end
        begun |= state.mode in COMING_DOWN.values()
        there = self._given_for is not None and self._given_for[0] == home and self._done
        return end if home is None or end == Hold() or self.lost or begun or there else home

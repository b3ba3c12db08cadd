# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Chooses the next order of a drone's vehicle, without ROS, links and clocks.

`VehicleCustody` decides who controls the vehicle and which orders are allowed; this module decides
which order is wanted.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import cast

from dsse_ros.bridge.clearance import Clearance
from dsse_ros.bridge.custody import MAY_ORDER, Custody, Event
from dsse_ros.bridge.fence import Fence, check_horizontal, check_take_off
from dsse_ros.bridge.flight_record import FlightRecord, SearchId
from dsse_ros.bridge.settings import BridgeSettings
from dsse_ros.bridge.tasks import Task
from dsse_ros.bridge.vehicle_custody import (
    COMING_DOWN,
    CONTINUES,
    RISEN_M,
    Arm,
    VehicleCustody,
)
from dsse_ros.flight.autopilots import AUTOPILOTS
from dsse_ros.flight.offset import offset_m
from dsse_ros.flight.orders import (
    FlyMission,
    GoTo,
    Hold,
    Land,
    MakeReady,
    Return,
    Search,
    TakeOff,
)
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
_AWAY_S = 2.0
"""How long a vehicle may be out of its place, or of the fence: a fault of the GPS ends sooner."""
_AWAY_M = 5.0
"""How far out of its place, or beyond a limit of altitude, a vehicle may be."""
_CLIMBS_MPS = 0.3
"""Speed above which a vehicle is certain to climb."""
_ENDS: dict[str, Order] = {"return": Return(), "land": Land(), "hold": Hold()}


class VehicleFollower:
    """Makes one vehicle follow its drone along its legs, one order at a time.

    Args:
        settings: Settings of the bridge.
        record: Its record so far.

    Attributes:
        custody: Who has it.
        leg: The current leg, None before the first step.
        arrived: Whether it has done all of the leg.
        no_take_off: Why it must not take off from where it stands; empty if it may.
        blocked: What keeps it from doing what it should; empty if nothing does.
        ready: Whether it could take off now if the other vehicles allow it.
        risen: Whether it has been at its altitude in this search.
        finished: Whether it has nothing left to do in this search.
        leaves_layer: Why it would leave its layer to return by itself; empty if it would not.
    """

    def __init__(
        self,
        settings: BridgeSettings,
        record: FlightRecord | None = None,
    ) -> None:
        self._settings = settings
        self._autopilot = AUTOPILOTS[settings.autopilot]
        self._whole = settings.mode == "mission"
        self._top_amsl_m = 0.0
        self._highest_amsl_m = -math.inf
        self._fence: Fence | None = None
        self.leaves_layer = ""
        self._forget_search()
        self.custody = VehicleCustody(
            self._autopilot,
            cast(Arm, settings.arm),
            record or FlightRecord(),
            self._forget_order,
            at_end=settings.at_end,
            whole=self._whole,
        )

    def _forget_search(self) -> None:
        self.leg: Leg | None = None
        self.arrived = False
        self.no_take_off = ""
        self.blocked = ""
        self.ready = False
        self.risen = False
        self.finished = False
        self._task: Task = ()
        self._task_refused = ""
        self._stage = 0
        self._holding = False
        # Since when it has been out of its place, outside the fence, and too low.
        self._away_since_s = self._outside_since_s = self._low_since_s = math.inf
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
        self, search: SearchId, top_amsl_m: float, fence: Fence, *, first: bool = False
    ) -> None:
        """Follow a search.

        Args:
            search: The search.
            top_amsl_m: Altitude above mean sea level to take off to.
            fence: Where the vehicle may be, and take off.
            first: Whether it is the first search of this program, for which the parameter `arm`
                may clear the vehicle.
        """
        self._forget_search()
        self._top_amsl_m, self._fence = top_amsl_m, fence
        self.custody.begin(search, top_amsl_m, first=first)

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
        self._task = task.value if isinstance(task, Accepted) else ()
        self._task_refused = task.reason if isinstance(task, Rejected) else ""
        looked = self.custody.record.looked_ns == leg.stamp_ns
        self._stage = 1 if looked and len(self._task) > 1 else 0
        if self._late is None:
            self._late = leg.over and not self._whole

    def hold(self) -> None:
        """Hold until the next leg."""
        self._holding = True

    def replace_vehicle(self, record: FlightRecord) -> None:
        """Follow with another vehicle that has turned out to be connected.

        Args:
            record: That vehicle's record.
        """
        self._forget_order()
        self.risen = self.arrived = False
        self.custody.replace_vehicle(record)

    def drop_out(self, why: str) -> None:
        """Stop following the drone."""
        self.custody.lose(why)
        self.custody.on(Event.DROP_OUT)

    @property
    def refused(self) -> str:
        """Why the task, or the take-off, is refused; empty if it is not."""
        return f"take-off: {self.no_take_off}" if self.no_take_off else self._task_refused

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
        return bool(self._task or self._task_refused)

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
        self.custody.lapse(now_s)
        self._watch(state, now_s, trouble)
        self.custody.clear_automatically(now_s)
        self._await_take_off(state, outcome, now_s, trouble, clearance)
        self.finished = self._is_finished(state)
        return self._next_order(state, now_s, clearance) if state.connected else None

    def await_identity(self, state: VehicleState, now_s: float, trouble: str) -> None:
        """Let time pass while it is not known which vehicle is connected."""
        self._await_take_off(state, Outcome(), now_s, trouble, Clearance())

    @property
    def _wanted_task(self) -> Order | None:
        """The order of the task that is due; None without a task."""
        return self._task[self._stage] if self._task else None

    def _look(self, outcome: Outcome, now_s: float) -> None:
        """Handle the outcome of the order."""
        if self._given is None or outcome.order != self._given:
            return
        self._done = outcome.status == "done"
        wanted = self._wanted_task
        if self._done and wanted is not None and self._given_for == self._stamped(wanted):
            self._advance_task()
        if outcome.status == "failed" and self._failed_s is None:
            self._failed_s = now_s
            # A mission that is started again would fly the whole search again.
            last = self._tries >= TRIES or outcome.final or isinstance(self._given, FlyMission)
            if last and not self.lost:
                self.drop_out(f"failed: {outcome.reason}")

    def _advance_task(self) -> None:
        """Go on to the next order of the task, or be there."""
        if isinstance(self._wanted_task, Search) and self.leg is not None:
            self.custody.look_done(self.leg.stamp_ns)
        if self._stage + 1 < len(self._task):
            self._stage += 1
        else:
            self.arrived = True

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
            nothing_left = self.arrived or not self._task or leg.crashed or bool(self._late)
            custody.over = nothing_left or custody.state is not Custody.FOLLOWING

    def _watch(self, state: VehicleState, now_s: float, trouble: str) -> None:
        """Recognise whether the vehicle cannot follow its drone any further, or need not."""
        custody = self.custody
        self.risen |= state.has_position and state.alt_amsl_m > self._top_amsl_m - RISEN_M
        if self.mission_under_way and self._waits_over_home(state):
            self.arrived = custody.over = True
        if custody.over and custody.record.search == custody.search:
            custody.on(Event.SEARCH_OVER)
        if not (custody.airborne or custody.state is Custody.CLEARED):
            return
        if state.connected and state.flying and state.has_position:
            self._highest_amsl_m = max(self._highest_amsl_m, state.alt_amsl_m)
            self._watch_place(state, now_s)
        elif not state.flying:
            self._highest_amsl_m = -math.inf
        because = f": {trouble}" if trouble else ""
        silent = bool(state.mode) and not state.connected
        if state.problem or state.identity.twins:
            self.drop_out(state.problem or state.identity.twins)
        elif silent and now_s - state.heard_s >= self._settings.lost_timeout and not self.lost:
            timeout_s = self._settings.lost_timeout
            self.drop_out(f"link lost: no heartbeat for {timeout_s:g} s{because}")
        elif self._has_failsafe(state, now_s):
            self.drop_out(f"{state.failsafe} failsafe")
            if self._autopilot.acts_when_critical:
                custody.on(Event.FAILSAFE)

    def _watch_place(self, state: VehicleState, now_s: float) -> None:
        """Recognise whether it has left its place, the fence or the air without an order."""
        custody, fence = self.custody, self._fence
        self._away_since_s = _since(self._away_since_s, now_s, when=self._is_away(state))
        if now_s - self._away_since_s >= _AWAY_S:
            # It is ordered there again.
            self.arrived, self._given_for = False, None
        if fence is None or not custody.airborne:
            return
        self._low_since_s = _since(self._low_since_s, now_s, when=self._falls(state, fence))
        if now_s - self._low_since_s >= _AWAY_S:
            custody.fall(f"fell to {state.alt_m:.0f} m above home without an order")
            self.arrived = False
            return
        outside = self._outside(state, fence)
        self._outside_since_s = _since(self._outside_since_s, now_s, when=bool(outside))
        if now_s - self._outside_since_s >= _AWAY_S and custody.state is Custody.FOLLOWING:
            self.drop_out(f"outside the fence: {outside}")

    def _falls(self, state: VehicleState, fence: Fence) -> bool:
        """Return whether it is too low without an order to be there."""
        custody = self.custody
        ordered = custody.state is Custody.RECALLED or isinstance(self._given, Return | Land)
        if self._whole:
            # The last item brings it down.
            last = custody.record.items - 1 + self._autopilot.first_item
            ordered |= not custody.record.items or state.item_current >= last
        if ordered or state.mode in COMING_DOWN.values():
            return False
        climbing = isinstance(self._given, TakeOff) and not self._done
        lost_height = self._highest_amsl_m - state.alt_amsl_m > _AWAY_M
        falls = lost_height or not (climbing or self.risen or state.climb_mps > _CLIMBS_MPS)
        return falls and state.alt_amsl_m < fence.min_amsl_m - _AWAY_M

    def _is_away(self, state: VehicleState) -> bool:
        """Return whether it is not where it has arrived."""
        place = self._wanted_task
        stays = self.arrived and self.custody.state is Custody.FOLLOWING
        if not (stays and isinstance(place, GoTo)):
            return False
        here, there = (state.lat_deg, state.lon_deg), (place.lat_deg, place.lon_deg)
        away_m = math.hypot(*offset_m(here, there)) - place.radius_m
        return max(away_m, abs(state.alt_amsl_m - place.alt_amsl_m)) > _AWAY_M

    def _outside(self, state: VehicleState, fence: Fence) -> str:
        """Return why it is outside the fence; empty if it is inside."""
        if self._whole:
            # A mission goes on without the bridge, and all of it is checked before.
            return ""
        refused = check_horizontal(state.lat_deg, state.lon_deg, fence)
        if refused:
            return refused.reason
        if state.alt_amsl_m > fence.max_amsl_m + _AWAY_M:
            return f"altitude must be at most {fence.max_amsl_m:g} m, got {state.alt_amsl_m:.0f}"
        return ""

    def _has_failsafe(self, state: VehicleState, now_s: float) -> bool:
        """Return whether a failsafe, or a lasting critical state, ends following the drone."""
        certain = self._autopilot.acts_when_critical and state.failsafe != "critical"
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
        task = self._wanted_task
        if not isinstance(task, FlyMission) or task.hold_item < 0 or not state.has_position:
            return False
        if state.mode != self._autopilot.mission_mode:
            # The item stays the current one if a person ends the mission.
            return False
        item = task.items[task.hold_item]
        away = offset_m((state.lat_deg, state.lon_deg), (item.lat_deg, item.lon_deg))
        return state.item_current == task.hold_item and math.hypot(*away) <= _OVER_HOME_M

    def _is_finished(self, state: VehicleState) -> bool:
        if self.leg is None:
            return False
        if self.custody.airborne and state.connected:
            at_rest = self._given == _ENDS[self._settings.at_end] and self._done
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
            self.blocked, self.no_take_off, self._blocked_since_s = "", "", None
            return
        because = f": {trouble}" if trouble else ""
        what, why = self._reason_not_to_fly(state, outcome, because)
        self.blocked = what + why
        if what:
            if self._blocked_since_s is None:
                self._blocked_since_s = now_s
            if now_s - self._blocked_since_s > self._settings.join_timeout:
                self.drop_out(f"{what} within {self._settings.join_timeout:g} s{why}")
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
        if state.problem or state.identity.twins:
            return state.problem or state.identity.twins, ""
        if state.identity.uid is None:
            return "no AUTOPILOT_VERSION", because
        because = because or (f": {state.unready}" if state.unready else "")
        if not state.has_position:
            return "no position", because
        if self._whole and not self.has_task:
            return "no home position", because
        if self.custody.state is not Custody.CLEARED or state.armed:
            return "", ""
        self.no_take_off = self._reason_to_stay(state)
        if self.no_take_off:
            return "no take-off", f": {self.no_take_off}"
        # Readiness may depend on the mode, which `MakeReady` sets.
        prepared = self._done or not isinstance(self._given, MakeReady)
        if not (state.ready and prepared):
            waits = self._given is not None and outcome.reason
            return "not ready", f": {outcome.reason}" if waits else because
        return "", ""

    def _reason_to_stay(self, state: VehicleState) -> str:
        """Return why it must not take off from its position; empty if it may."""
        assert self._fence is not None
        top_m, limit_m = self._top_amsl_m, self._fence.max_amsl_m
        checked = check_take_off(state.lat_deg, state.lon_deg, top_m, self._fence)
        if isinstance(checked, Rejected):
            return checked.reason
        home_m = state.alt_amsl_m - state.alt_m
        if top_m - home_m < self._settings.min_altitude:
            return (
                f"altitude must be at least {self._settings.min_altitude:g} m above home, got "
                f"{top_m - home_m:g} m (home is {home_m:g} m above the sea: see datum_altitude)"
            )
        return_m = home_m + state.return_alt_m
        if return_m > limit_m:
            return (
                f"the vehicle's return altitude must be at most {limit_m:g} m above the sea, got "
                f"{return_m:g}"
            )
        return ""

    # Orders

    def _next_order(self, state: VehicleState, now_s: float, clearance: Clearance) -> Order | None:
        wanted = self._wanted(state, clearance)
        if wanted is None or not isinstance(wanted, MAY_ORDER[self.custody.state]):
            return None
        given_for, tries = self._stamped(wanted), 1
        # A vehicle that has dropped out, or was recalled, does not wait for others.
        waits = not self.lost and self.custody.state is not Custody.RECALLED
        if given_for == self._given_for:
            intruder = clearance.intruder(self._given) if waits and not self._done else ""
            if intruder and self._may_stop:
                self.blocked = intruder
                return self._give(Hold(), (Hold(), 0), 1, state)
            if self._failed_s is None or now_s - self._failed_s < RETRY_S:
                return None
            tries = self._tries + 1
        order = wanted
        if waits:
            admitted = clearance.admit(wanted)
            if isinstance(admitted, str):
                self.blocked = admitted
                return None
            order = admitted
        return self._give(order, given_for, tries, state)

    @property
    def _may_stop(self) -> bool:
        """Whether it may be ordered to hold where it is."""
        return not self._whole and Hold in MAY_ORDER[self.custody.state]

    def _give(
        self, order: Order, given_for: tuple[Order, int], tries: int, state: VehicleState
    ) -> Order:
        self._given, self._given_for, self._tries = order, given_for, tries
        self._done, self._failed_s = False, None
        if isinstance(order, TakeOff | FlyMission) and order.arm and not state.armed:
            self.custody.launch()
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
                record = self.custody.record
                from_mode = record.modes[0] if record.modes else ""
                return Land(from_mode) if record.end == "land" else Return(from_mode)
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
            return TakeOff(self._top_amsl_m, arm, modes)
        mission = self._wanted_task
        if isinstance(mission, FlyMission):
            return replace(mission, arm=arm, from_modes=modes)
        return None

    def _wanted_in_the_air(self, state: VehicleState) -> Order | None:
        custody = self.custody
        if self._whole or self.leg is None or custody.record.search != custody.search:
            # A mission ends by itself, and goes on without the bridge.
            return None
        if isinstance(self._given, TakeOff) and not self._done:
            # An order to fly somewhere would end the climb.
            return self._given
        if not state.flying or self._outside_since_s < math.inf:
            return None
        return Hold() if self._holding else self._wanted_task or Hold()

    def _wanted_at_the_end(self, state: VehicleState, clearance: Clearance) -> Order | None:
        end, home = _ENDS["return" if self._whole else self._settings.at_end], clearance.home
        # An earlier program may have begun the end.
        begun = self._given_for is not None and self._given_for[0] == end
        begun |= state.mode in COMING_DOWN.values()
        there = self._given_for is not None and self._given_for[0] == home and self._done
        return end if home is None or end == Hold() or self.lost or begun or there else home


def _since(since_s: float, now_s: float, *, when: bool) -> float:
    """Return since when something is the case; infinity while it is not."""
    return min(since_s, now_s) if when else math.inf

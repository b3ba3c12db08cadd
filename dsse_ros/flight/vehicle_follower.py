# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a drone's vehicle is to do next, without ROS, links and clocks.

A vehicle takes off once in a mission at the most, for a search that is going on and a drone that is
still in it. What must be known of that when the program is started again is its `FlightRecord`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

from dsse_ros.flight.autopilots import Autopilot
from dsse_ros.flight.fence import Fence, check_mission, check_place, check_take_off
from dsse_ros.flight.mission_messages import WireItem
from dsse_ros.flight.orders import FlyMission, GoTo, Hold, Land, Return, Search, TakeOff
from dsse_ros.flight.vehicle_controller import Order, Outcome
from dsse_ros.flight.vehicle_state import VehicleState
from msg_adapters.frames import GridFrame
from msg_adapters.geodesy import cell_to_geodetic
from msg_adapters.mavlink_items import mission_fields
from msg_adapters.mission_items import NAV_WAYPOINT, Mission
from msg_adapters.result import Accepted, Rejected, Result
from msg_adapters.track_missions import Leg, acceptance_radius_m

TRIES = 3
"""How often an order is given that fails."""
RETRY_S = 5.0
CRITICAL_S = 5.0
"""Time in which an autopilot that is critical without a reason may recover."""

Task = GoTo | Search | FlyMission


@dataclass(frozen=True)
class FlightRecord:
    """What must be known of a vehicle for as long as the mission lasts.

    Attributes:
        took_off: Whether it has been in the air.
        lost: Why it does not follow its drone any more; empty if it does.
        taken_over: Whether that is because a pilot or another program has it; nothing is sent then.
    """

    took_off: bool = False
    lost: str = ""
    taken_over: bool = False


class LegSettings(Protocol):
    """How legs are flown."""

    @property
    def acceptance_radius(self) -> float:
        """Distance from the centre of a cell, m."""

    @property
    def search_altitude(self) -> float:
        """Altitude above home of a search, m."""

    @property
    def search_hold(self) -> float:
        """How long it holds there, s."""


def leg_task(leg: Leg, frame: GridFrame, settings: LegSettings, fence: Fence) -> Result[Task]:
    """Return what a vehicle has to do for a leg, or why it may not.

    Args:
        leg: The leg.
        frame: The grid, at the vehicle's flight altitude.
        settings: How it is flown.
        fence: Where it may be.
    """
    lat_deg, lon_deg, _ = cell_to_geodetic(frame, *leg.cell, frame.alt_m)
    search_alt_m = min(settings.search_altitude, frame.alt_m)
    for alt_m in (frame.alt_m, search_alt_m if leg.searched else frame.alt_m):
        checked = check_place(lat_deg, lon_deg, alt_m, fence)
        if isinstance(checked, Rejected):
            return checked
    radius_m = acceptance_radius_m(frame, settings.acceptance_radius)
    if leg.searched:
        return Accepted(
            Search(lat_deg, lon_deg, frame.alt_m, search_alt_m, settings.search_hold, radius_m)
        )
    return Accepted(GoTo(lat_deg, lon_deg, frame.alt_m, radius_m))


def mission_task(mission: Mission, fence: Fence, autopilot: Autopilot) -> Result[Task]:
    """Return the order to fly a mission, or why it may not be flown."""
    checked = check_mission(mission.numbered(autopilot.name), fence, autopilot.name)
    if isinstance(checked, Rejected):
        return checked
    items = checked.value
    if not autopilot.keeps_item_radius:
        # It has one radius for all waypoints, and returns 0 for that of an item.
        items = tuple(
            replace(item, param2=0.0) if item.command == NAV_WAYPOINT else item for item in items
        )
    return Accepted(FlyMission(tuple(WireItem(**fields) for fields in mission_fields(items))))


def takes_off_yet(state: VehicleState, outcome: Outcome) -> bool:
    """Whether a vehicle on the ground is going to take off, if only when it is connected again."""
    pending = outcome.status not in ("idle", "done", "failed", "taken_over")
    return not state.flying and pending and isinstance(outcome.order, TakeOff | FlyMission)


class VehicleFollower:
    """Has one vehicle follow its drone along its legs, one order at a time.

    Args:
        take_off_alt_m: Altitude above home to take off to.
        fence: Where the vehicle may be, and take off.
        at_end: What it does when its drone's search is over: return, land or hold.
        join_timeout_s: Time in which it must be able to take off.
        lost_timeout_s: Time without a heartbeat after which it is lost.
        whole: Whether the search is flown as one mission, once it is over.

    Attributes:
        leg: What is to be done, None before the first step.
        arrived: Whether all of it is done.
        record: What must be known of it when the program is started again.
        refused: Why the task, or the take-off, is refused; empty if it is not.
        blocked: What keeps it from taking off now, empty if nothing does or it need not.
        finished: Whether nothing is left to do in this mission.
    """

    def __init__(
        self,
        take_off_alt_m: float,
        fence: Fence,
        at_end: str,
        join_timeout_s: float,
        lost_timeout_s: float,
        *,
        whole: bool = False,
    ) -> None:
        self._take_off = TakeOff(take_off_alt_m)
        self._fence = fence
        ends: dict[str, Order] = {"return": Return(), "land": Land(), "hold": Hold()}
        self._end = ends[at_end]
        self._join_timeout_s = join_timeout_s
        self._lost_timeout_s = lost_timeout_s
        self._whole = whole
        self.begin()

    def begin(self, record: FlightRecord | None = None) -> None:
        """Start with a mission, of which this is known; with a new one all may be there again."""
        self.leg: Leg | None = None
        self.arrived = False
        self.record = record or FlightRecord()
        self.refused = ""
        self.blocked = ""
        self.finished = False
        self._task: Task | None = None
        self._holding = False
        # Whether the search was over, or its mission under way, when this began; None before that.
        self._late: bool | None = None
        # The order given last, with the stamp of its leg if it is to be done for each leg anew.
        self._given: tuple[Order, int] | None = None
        self._done = False
        self._tries = 0
        self._failed_s: float | None = None
        self._blocked_since_s: float | None = None
        self._critical_since_s: float | None = None

    @property
    def lost(self) -> str:
        """Why the vehicle does not follow its drone any more; empty if it does."""
        return self.record.lost

    @property
    def arrived_stamp_ns(self) -> int:
        """Stamp of the leg, if all of it is done; else -1."""
        return self.leg.stamp_ns if self.leg is not None and self.arrived else -1

    @property
    def waiting(self) -> bool:
        """Whether it has nothing to do until the next step."""
        return self.leg is None or self.arrived or self.leg.over or bool(self.lost or self.refused)

    @property
    def has_task(self) -> bool:
        """Whether it is known what there is to do for the leg, be it that it is refused."""
        return self._task is not None or bool(self.refused)

    def follow(self, leg: Leg, task: Result[Task] | None) -> None:
        """Take a leg, and what there is to do for it, in place of the one before.

        Args:
            leg: The leg.
            task: What there is to do, or why it may not be done; None if it is not known yet.
        """
        before = self.leg
        known = self.has_task or task is None
        if before and known and (leg.stamp_ns, leg.cell) == (before.stamp_ns, before.cell):
            # A step that is reported again: its end alone may be new.
            self.leg = leg
            return
        self.leg, self._holding, self.arrived = leg, False, False
        self._task = task.value if isinstance(task, Accepted) else None
        self.refused = task.reason if isinstance(task, Rejected) else ""

    def hold(self) -> None:
        """Have it hold until the next leg."""
        self._holding = True

    def advance(
        self,
        state: VehicleState,
        outcome: Outcome,
        now_s: float,
        trouble: str = "",
        *,
        search_alive: bool = True,
    ) -> Order | None:
        """Return the order to give now, None if there is no new one.

        Args:
            state: What the vehicle reports.
            outcome: What has become of the order given last.
            now_s: Time on a steady clock, the one of `state.heard_s`.
            trouble: What is wrong with its link; empty if nothing.
            search_alive: Whether the search is there; without it nothing takes off.
        """
        if self.leg is None:
            return Hold() if takes_off_yet(state, outcome) else None
        if self._late is None:
            self._late = self.leg.over and (self.record.took_off or not self._whole)
        self._look(outcome, now_s)
        if state.flying and not self.record.took_off:
            self.record = replace(self.record, took_off=True)
        if not self.lost:
            self._watch(state, outcome, now_s, trouble)
        self.finished = self._is_finished(state, outcome)
        if self.record.taken_over:
            return None
        # As soon as it is connected again it would take off: that is prevented first.
        stopped = bool(self.lost) and takes_off_yet(state, outcome)
        if not (state.connected or stopped):
            return None
        order = self._wanted(state, outcome, search_alive)
        if order is None:
            return None
        stamped = self._stamped(order)
        if stamped != self._given:
            self._given, self._tries = stamped, 1
        elif self._failed_s is not None and now_s - self._failed_s >= RETRY_S:
            self._tries += 1
        else:
            return None
        self._done, self._failed_s = False, None
        return order

    def _stamped(self, order: Order) -> tuple[Order, int]:
        assert self.leg is not None
        return order, self.leg.stamp_ns if isinstance(order, Search) else 0

    def _look(self, outcome: Outcome, now_s: float) -> None:
        """See what has become of the order."""
        if self._given is None or outcome.order != self._given[0]:
            return
        self._done = outcome.status == "done"
        if outcome.status == "failed" and self._failed_s is None:
            self._failed_s = now_s
            # A mission that is begun again would fly the whole search again.
            last = self._tries >= TRIES or outcome.final
            last = last or (self._whole and self.record.took_off)
            if last and not self.lost:
                self._lose(f"failed: {outcome.reason}")
        if self._done and self._task is not None and self._given == self._stamped(self._task):
            self.arrived = True

    def _lose(self, why: str, *, taken_over: bool = False) -> None:
        self.record = replace(self.record, lost=why, taken_over=taken_over)

    def _watch(self, state: VehicleState, outcome: Outcome, now_s: float, trouble: str) -> None:
        """See whether the vehicle cannot go on with its drone."""
        assert self.leg is not None
        if self.leg.over and self.arrived:
            return
        because = f": {trouble}" if trouble else ""
        if state.mode and not state.connected and now_s - state.heard_s >= self._lost_timeout_s:
            self._lose(f"link lost: no heartbeat for {self._lost_timeout_s:g} s{because}")
        elif self._given is not None and outcome.status == "taken_over":
            self._lose(f"taken over: {outcome.reason}", taken_over=True)
        elif self._given is not None and self._has_failsafe(state, now_s):
            self._lose(f"{state.failsafe} failsafe")
        elif self.record.took_off and state.connected and not state.flying and not state.armed:
            if not self.leg.over:
                self._lose("on the ground again before the end of the search")
        else:
            self._await_take_off(state, outcome, now_s, because)

    def _has_failsafe(self, state: VehicleState, now_s: float) -> bool:
        """Whether a failsafe has struck that does not end in time."""
        if state.failsafe != "critical":
            self._critical_since_s = None
            # From missed setpoints the controller recovers by itself.
            return state.failsafe not in ("", "offboard")
        # Without a name it may be about to become one of those.
        if self._critical_since_s is None:
            self._critical_since_s = now_s
        return now_s - self._critical_since_s >= CRITICAL_S

    def _await_take_off(
        self, state: VehicleState, outcome: Outcome, now_s: float, because: str
    ) -> None:
        """Wait until it could take off, for as long as it may take."""
        what, why = self._hindrance(state, outcome, because)
        self.blocked = what + why
        if not what:
            self._blocked_since_s = None
            return
        if self._blocked_since_s is None:
            self._blocked_since_s = now_s
        if now_s - self._blocked_since_s > self._join_timeout_s:
            self._lose(f"{what} within {self._join_timeout_s:g} s{why}")

    def _hindrance(self, state: VehicleState, outcome: Outcome, because: str) -> tuple[str, str]:
        """Return what keeps it from taking off, and why; empty if nothing does."""
        assert self.leg is not None
        if state.armed or self.record.took_off or (self.leg.over and not self._whole):
            return "", ""
        if not state.mode:
            return "no heartbeat", because
        if not state.connected:
            return "", ""
        because = because or (f": {state.unready}" if state.unready else "")
        if not state.has_position:
            return "no position", because
        if not self.has_task:
            return "no home position", because
        if not state.ready:
            waits = takes_off_yet(state, outcome) and outcome.reason
            return "not ready", f": {outcome.reason}" if waits else because
        if self.refused and self._task is not None:
            return "no take-off", f": {self.refused}"
        return "", ""

    def _is_finished(self, state: VehicleState, outcome: Outcome) -> bool:
        assert self.leg is not None
        if self.lost:
            return True
        if not self.leg.over:
            return False
        at_rest = not state.armed and not state.flying and not takes_off_yet(state, outcome)
        if self._whole:
            return self.arrived or (bool(self._late) and at_rest)
        return at_rest or (self._given is not None and self._given[0] == self._end and self._done)

    def _wanted(self, state: VehicleState, outcome: Outcome, search_alive: bool) -> Order | None:
        """Return what the vehicle should be doing, None where no order is needed."""
        assert self.leg is not None
        # On the ground after a flight nothing is under way but its end.
        takes_off = takes_off_yet(state, outcome) and not self.record.took_off
        stop = Hold() if takes_off else None
        if self._whole and not self.lost:
            # It has its own end, and goes on without us.
            if self.arrived or self._late or state.flying:
                return None
            return self._task if self._task and self._may_take_off(state) else stop
        done = self.arrived or self._task is None or self.leg.crashed or self._late
        if self.lost or (self.leg.over and done):
            return self._end if state.flying or takes_off else None
        if self._task is None or self._holding:
            return Hold() if state.flying else stop
        if state.flying:
            # A place to fly to would end the climb.
            climbs = self._given is not None and self._given[0] == self._take_off and not self._done
            return self._take_off if climbs else self._task
        going_on = search_alive and not self.leg.over
        return self._take_off if going_on and self._may_take_off(state) else stop

    def _may_take_off(self, state: VehicleState) -> bool:
        """Return whether the vehicle has not flown yet and its place is in the fence."""
        if not state.has_position or self.record.took_off:
            return False
        alt_m = self._take_off.alt_m
        checked = check_take_off(state.lat_deg, state.lon_deg, alt_m, self._fence)
        self.refused = f"take-off: {checked.reason}" if isinstance(checked, Rejected) else ""
        return not self.refused

# SPDX-License-Identifier: Apache-2.0
"""What a drone's vehicle is to do next, without ROS, links and clocks."""

from __future__ import annotations

from dataclasses import dataclass, replace

from dsse_ros.flight.items import WireItem
from dsse_ros.flight.orders import FlyMission, GoTo, Hold, Land, Order, Return, Search, TakeOff
from dsse_ros.flight.pilot import Outcome
from dsse_ros.flight.vehicle_state import VehicleState
from dsse_ros.nodes.flight_settings import BridgeSettings
from dsse_ros.nodes.track_files import acceptance_radius_m
from msg_adapters.fence import Fence, check_mission, check_place
from msg_adapters.frames import GridFrame
from msg_adapters.geodesy import cell_to_geodetic
from msg_adapters.mavlink_items import mission_fields
from msg_adapters.mission_files import Firmware, Mission
from msg_adapters.mission_items import NAV_WAYPOINT
from msg_adapters.result import Accepted, Rejected, Result

TRIES = 3
"""How often an order is given that fails."""
RETRY_S = 5.0

Task = GoTo | Search | FlyMission


@dataclass(frozen=True)
class Leg:
    """What a step asks of one drone's vehicle.

    Attributes:
        stamp_ns: Stamp of the step's report.
        cell: (col, row) where the drone is now.
        searched: Whether it has searched there in this step.
        over: Whether its search is over.
        crashed: Whether that is because another drone is in its cell: no vehicle follows it there.
    """

    stamp_ns: int
    cell: tuple[int, int]
    searched: bool = False
    over: bool = False
    crashed: bool = False


def leg_task(leg: Leg, frame: GridFrame, settings: BridgeSettings, fence: Fence) -> Result[Task]:
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
    radius_m = acceptance_radius_m(frame, settings)
    if leg.searched:
        return Accepted(
            Search(lat_deg, lon_deg, frame.alt_m, search_alt_m, settings.search_hold, radius_m)
        )
    return Accepted(GoTo(lat_deg, lon_deg, frame.alt_m, radius_m))


def mission_task(mission: Mission, fence: Fence, firmware: Firmware) -> Result[Task]:
    """Return the order to fly a mission, or why it may not be flown."""
    checked = check_mission(mission.numbered(firmware), fence, firmware)
    if isinstance(checked, Rejected):
        return checked
    items = checked.value
    if firmware == "ardupilot":
        # ArduCopter has one radius for all and keeps none of an item: 0 is what it reads back.
        items = tuple(
            replace(item, param2=0.0) if item.command == NAV_WAYPOINT else item for item in items
        )
    return Accepted(FlyMission(tuple(WireItem(**fields) for fields in mission_fields(items))))


def takes_off_yet(state: VehicleState, outcome: Outcome) -> bool:
    """Whether a vehicle on the ground is going to take off, be it when it is heard again."""
    pending = outcome.status in ("under_way", "lost")
    return not state.flying and pending and isinstance(outcome.order, TakeOff | FlyMission)


class Escort:
    """Leads one vehicle along its drone's legs, one order at a time.

    Args:
        take_off_alt_m: Altitude above home to take off to.
        fence: Where the vehicle may be, and take off.
        at_end: What it does when its drone's search is over: return, land or hold.
        join_timeout_s: Time in which it must be heard for the first time.

    Attributes:
        leg: What is to be done, None before the first step.
        arrived: Whether all of it is done.
        lost: Why the vehicle does not follow its drone any more; empty if it does.
        refused: Why the task, or the take-off, is refused; empty if it is not.
    """

    def __init__(
        self, take_off_alt_m: float, fence: Fence, at_end: str, join_timeout_s: float
    ) -> None:
        self._take_off = TakeOff(take_off_alt_m)
        self._fence = fence
        ends: dict[str, Order] = {"return": Return(), "land": Land(), "hold": Hold()}
        self._end = ends[at_end]
        self._join_timeout_s = join_timeout_s
        self.begin()

    def begin(self) -> None:
        """Start anew with a new mission: who was lost may be there again."""
        self.leg: Leg | None = None
        self.arrived = False
        self.lost = ""
        self.refused = ""
        self._task: Task | None = None
        self._holding = False
        # The order given last, with the stamp of its leg if it is to be done for each leg anew.
        self._given: tuple[Order, int] | None = None
        self._done = False
        self._tries = 0
        self._failed_s: float | None = None
        self._since_s: float | None = None

    @property
    def arrived_stamp_ns(self) -> int:
        """Stamp of the leg, if all of it is done; else -1."""
        return self.leg.stamp_ns if self.leg is not None and self.arrived else -1

    @property
    def waiting(self) -> bool:
        """Whether it has nothing to do until the next step."""
        return self.leg is None or self.arrived or self.leg.over or bool(self.lost or self.refused)

    def follow(self, leg: Leg, task: Result[Task]) -> None:
        """Take a leg, and what there is to do for it, in place of the one before."""
        before = self.leg
        if before and (leg.stamp_ns, leg.cell) == (before.stamp_ns, before.cell):
            # A step that is told again: its end alone may be new.
            self.leg = leg
            return
        self.leg, self._holding, self.arrived = leg, False, False
        self._task = task.value if isinstance(task, Accepted) else None
        self.refused = task.reason if isinstance(task, Rejected) else ""

    def hold(self) -> None:
        """Have it hold until the next leg."""
        self._holding = True

    def advance(
        self, state: VehicleState, outcome: Outcome, now_s: float, trouble: str = ""
    ) -> Order | None:
        """Return the order to give now, None if there is nothing new to say.

        Args:
            state: What the vehicle says of itself.
            outcome: What has become of the order given last.
            now_s: Time on a steady clock.
            trouble: What is wrong with its link; empty if nothing.
        """
        if self.leg is None:
            return Hold() if takes_off_yet(state, outcome) else None
        self._since_s = now_s if self._since_s is None else self._since_s
        self._look(outcome, now_s)
        self.lost = self.lost or self._drop_out(state, outcome, now_s, trouble)
        if outcome.status == "taken_over" and self._given is not None:
            return None
        # As soon as it is heard again it would take off: that is stopped before.
        stopped = bool(self.lost) and takes_off_yet(state, outcome)
        order = self._wanted(state, outcome) if state.connected or stopped else None
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
            if self._tries >= TRIES:
                self.lost = self.lost or f"failed: {outcome.reason}"
        if self._done and self._task is not None and self._given == self._stamped(self._task):
            self.arrived = True

    def _drop_out(self, state: VehicleState, outcome: Outcome, now_s: float, trouble: str) -> str:
        """Return why the vehicle cannot go on with its drone, empty if it can."""
        assert self.leg is not None and self._since_s is not None
        if self.leg.over and self.arrived:
            return ""
        because = f": {trouble}" if trouble else ""
        if not state.mode and now_s - self._since_s > self._join_timeout_s:
            return f"not heard within {self._join_timeout_s:g} s{because}"
        if outcome.status == "lost":
            return f"link lost: {outcome.reason}{because}"
        if self._given is None:
            return ""
        if outcome.status == "taken_over":
            return f"taken over: {outcome.reason}"
        # From missed set-points the pilot recovers by itself.
        return f"{state.failsafe} failsafe" if state.failsafe not in ("", "offboard") else ""

    def _wanted(self, state: VehicleState, outcome: Outcome) -> Order | None:
        """Return what the vehicle should be doing, None for nothing that it has to be told."""
        assert self.leg is not None
        takes_off = takes_off_yet(state, outcome)
        stop = Hold() if takes_off else None
        if isinstance(self._task, FlyMission) and not self.lost:
            # It has its own end.
            if self.arrived:
                return None
            return self._task if self._may_take_off(state) else stop
        done = self.arrived or self._task is None or self.leg.crashed
        if self.lost or (self.leg.over and done):
            return self._end if state.flying or takes_off else None
        if self._task is None or self._holding:
            return Hold() if state.flying else stop
        # A place to fly to would end the climb.
        climbs = self._given is not None and self._given[0] == self._take_off and not self._done
        if state.flying and not climbs:
            return self._task
        return self._take_off if self._may_take_off(state) else stop

    def _may_take_off(self, state: VehicleState) -> bool:
        """Return whether the vehicle's place is known and in the fence."""
        if not state.has_position:
            return False
        alt_m = self._take_off.alt_m
        checked = check_place(state.lat_deg, state.lon_deg, alt_m, self._fence)
        self.refused = f"take-off: {checked.reason}" if isinstance(checked, Rejected) else ""
        return not self.refused

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The mission as it is stored, and how it is flown, item by item."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from .maneuvers import GoTo, Hold, Land, Maneuver, Return, TakeOff
from .mission_items import Item
from .wire import mavlink

if TYPE_CHECKING:
    from .vehicle import Vehicle

_FLY_TO = frozenset(
    {
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT,
        mavlink.MAV_CMD_NAV_LOITER_TIME,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
    }
)
_WAIT = frozenset(
    {
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_LOITER_TIME,
        mavlink.MAV_CMD_NAV_DELAY,
    }
)


class Mission:
    """Items and progress.

    Attributes:
        items: By number; with ArduPilot number 0 is home.
        current: Number of the item that is flown, or would be.
        active: Whether it is being flown.
        finished: Whether it has been flown to its end.
        reached: Number of the item reached last, None if none was.
    """

    def __init__(self) -> None:
        self.items: list[Item] = []
        self.rewind(0)

    def rewind(self, first: int) -> None:
        """Go back to the start, or forth to any item."""
        self.current = first
        self.active = False
        self.finished = False
        self.reached: int | None = None
        self.jumps_left: dict[int, int] = {}


class MissionRun(Maneuver):
    """Fly the mission from its current item on.

    An item that was started is flown to its end, even if others have been stored meanwhile.
    """

    def __init__(self) -> None:
        self._item: Item | None = None
        self._leg: Maneuver = Hold()
        self._later_legs: list[Maneuver] = []
        self._waited_s = 0.0

    def step(self, vehicle: Vehicle, dt_s: float) -> None:
        mission = vehicle.mission
        if mission.active and self._item is None:
            if mission.current >= len(mission.items):
                self._end(vehicle)
            else:
                self._begin(mission.items[mission.current], vehicle)
        self._leg.step(vehicle, dt_s)
        self.target, self.landed_state = self._leg.target, self._leg.landed_state
        if self._item is not None and self._complete(self._item, vehicle, dt_s):
            item, self._item = self._item, None
            vehicle.item_reached(mission.current)
            following = self._following(item, mission)
            if following >= len(mission.items):
                self._end(vehicle)
            else:
                mission.current = following

    def _begin(self, item: Item, vehicle: Vehicle) -> None:
        self._item = item
        self._waited_s = 0.0
        legs = self._legs(item, vehicle)
        if legs:
            self._leg, *self._later_legs = legs
        if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            vehicle.change_speed(item.param2)
        vehicle.item_begun(vehicle.mission.current, item)

    def _legs(self, item: Item, vehicle: Vehicle) -> list[Maneuver]:
        here = vehicle.craft.point
        point = item.point(vehicle.frame, here)
        if item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            return [vehicle.take_off(point.up_m)]
        if item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return [vehicle.way_home()]
        if item.command == mavlink.MAV_CMD_NAV_DELAY:
            return [Hold()]
        if item.command == mavlink.MAV_CMD_NAV_LAND:
            return [GoTo(point._replace(up_m=here.up_m)), vehicle.landing()]
        if item.command not in _FLY_TO:
            return []
        if vehicle.landed and vehicle.takes_off_by_itself:
            return [vehicle.take_off(point.up_m), GoTo(point)]
        return [GoTo(point)]

    def _complete(self, item: Item, vehicle: Vehicle, dt_s: float) -> bool:
        match self._leg:
            case GoTo() as leg if not self._waited_s:
                done = leg.within(vehicle, vehicle.acceptance_radius_m(item))
            case TakeOff() | Land() | Return() as leg:
                done = leg.done
            case _:
                done = True
        if not done:
            return False
        if self._later_legs:
            self._leg = self._later_legs.pop(0)
            return False
        if item.command == mavlink.MAV_CMD_NAV_LOITER_UNLIM:
            return False
        if item.command in _WAIT:
            self._waited_s += dt_s
            # NaN waits for nothing.
            return not self._waited_s < item.param1 + dt_s
        return True

    @staticmethod
    def _following(item: Item, mission: Mission) -> int:
        if item.command == mavlink.MAV_CMD_DO_JUMP and 0 <= item.param1 < len(mission.items):
            for_ever = item.param2 < 0
            repeats = int(item.param2) if math.isfinite(item.param2) else 0
            left = mission.jumps_left.setdefault(mission.current, repeats)
            if for_ever or left > 0:
                mission.jumps_left[mission.current] = left - 1
                return int(item.param1)
        return mission.current + 1

    def _end(self, vehicle: Vehicle) -> None:
        vehicle.mission.active = False
        vehicle.mission.finished = True
        vehicle.mission_finished()

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Items of a mission as the vehicle stores them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .local_frame import LocalFrame, Point
from .wire import Message, mavlink

ABSOLUTE_FRAMES = frozenset({mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT})
RELATIVE_FRAMES = frozenset(
    {mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}
)
TERRAIN_FRAMES = frozenset(
    {mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT, mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT}
)
GLOBAL_FRAMES = ABSOLUTE_FRAMES | RELATIVE_FRAMES | TERRAIN_FRAMES

PLACES = frozenset(
    {
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        mavlink.MAV_CMD_NAV_LOITER_TIME,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT,
        mavlink.MAV_CMD_DO_SET_HOME,
        mavlink.MAV_CMD_DO_SET_ROI_LOCATION,
        mavlink.MAV_CMD_DO_SET_ROI,
    }
)
"""Commands that have a position."""


@dataclass(frozen=True)
class Item:
    """One item, with the fields of MISSION_ITEM_INT."""

    frame: int
    command: int
    autocontinue: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: int
    y: int
    z: float

    @classmethod
    def received(cls, message: Message) -> Item:
        """Take an item from MISSION_ITEM_INT, or from MISSION_ITEM, where degrees are floats."""
        x, y = message.x, message.y
        if message.get_type() == "MISSION_ITEM":
            x, y = (round(v * 1e7) if math.isfinite(v) else 2**31 - 1 for v in (x, y))
        numbers = (message.param1, message.param2, message.param3, message.param4)
        return cls(
            message.frame, message.command, message.autocontinue, *numbers, x, y, message.z
        )  # fmt: skip

    def message(
        self, seq: int, mission_type: int, target: tuple[int, int], *, current: bool, floats: bool
    ) -> Message:
        """Return it as MISSION_ITEM_INT, or as MISSION_ITEM with floats."""
        make = mavlink.MAVLink_mission_item_int_message
        x: float = self.x
        y: float = self.y
        if floats:
            make, x, y = mavlink.MAVLink_mission_item_message, x * 1e-7, y * 1e-7
        return make(
            *target, seq, self.frame, self.command, int(current), self.autocontinue,
            self.param1, self.param2, self.param3, self.param4, x, y, self.z, mission_type,
        )  # fmt: skip

    def place_fault(self) -> int | None:
        """Return the MAV_MISSION_RESULT that refuses its place, None if it is on the Earth."""
        if self.frame not in GLOBAL_FRAMES:
            return None
        if abs(self.x) > 90 * 10**7:
            return mavlink.MAV_MISSION_INVALID_PARAM5_X
        if abs(self.y) > 180 * 10**7:
            return mavlink.MAV_MISSION_INVALID_PARAM6_Y
        if not abs(self.z) < 83000:
            return mavlink.MAV_MISSION_INVALID_PARAM7
        return None

    def point(self, frame: LocalFrame, here: Point) -> Point:
        """Return where it is; latitude and longitude 0, and places out of reach, are `here`."""
        north_m, east_m = here.north_m, here.east_m
        if (self.x, self.y) != (0, 0):
            north_m, east_m = frame.horizontal(self.x * 1e-7, self.y * 1e-7)
        point = Point(north_m, east_m, height_m(self.z, self.frame, frame))
        return point if point.within_reach else here


def height_m(altitude_m: float, frame: int, local: LocalFrame, home_up_m: float = 0.0) -> float:
    """Return metres above the first home of an altitude in a MAV_FRAME.

    Args:
        altitude_m: The altitude.
        frame: The MAV_FRAME; the sea is the only terrain.
        local: Where the first home is.
        home_up_m: How much higher home is now.
    """
    if frame in ABSOLUTE_FRAMES:
        return altitude_m - local.home.alt_amsl_m
    return home_up_m + altitude_m

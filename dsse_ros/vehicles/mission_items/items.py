# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions of vehicles and their items, as files have them.

Commands and frames: https://mavlink.io/en/messages/common.html.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

NAV_WAYPOINT = 16
NAV_LOITER_TIME = 19
NAV_RETURN_TO_LAUNCH = 20
NAV_LAND = 21
NAV_TAKEOFF = 22
DO_CHANGE_SPEED = 178

FRAME_GLOBAL = 0
"""Altitude above mean sea level."""
FRAME_MISSION = 2
"""No place: the fields of the place are mere numbers. PX4 takes a return in no other frame."""
PLACELESS = (NAV_RETURN_TO_LAUNCH, DO_CHANGE_SPEED)
"""Commands in `FRAME_MISSION`."""
FRAME_GLOBAL_RELATIVE_ALT = 3
"""Altitude above home."""

_LIMITS = {"latitude": 90.0, "longitude": 180.0, "altitude": 1e6}


class Home(NamedTuple):
    """Where a vehicle takes off and returns to: degrees and metres above mean sea level."""

    lat_deg: float
    lon_deg: float
    alt_m: float


@dataclass(frozen=True)
class MissionItem:
    """One item of a mission; its number is its place in the list.

    Attributes:
        command: MAV_CMD.
        frame: MAV_FRAME, which says what the altitude is above.
        param1: As the command has it, likewise the next; NaN where it leaves the choice open.
        param2: For a waypoint the acceptance radius in metres.
        param3: For a waypoint the pass radius in metres.
        param4: For a waypoint the yaw in degrees.
        lat_deg: WGS84 latitude; in `FRAME_MISSION` parameter 5, a number like any other.
        lon_deg: WGS84 longitude; in `FRAME_MISSION` parameter 6.
        alt_m: Altitude in the frame; in `FRAME_MISSION` parameter 7.
    """

    command: int
    frame: int = FRAME_GLOBAL_RELATIVE_ALT
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    lat_deg: float = 0.0
    lon_deg: float = 0.0
    alt_m: float = 0.0

    @property
    def numbers(self) -> dict[str, float]:
        """The seven numbers of the command by name, in their order."""
        return {
            "param1": self.param1, "param2": self.param2, "param3": self.param3,
            "param4": self.param4, "latitude": self.lat_deg, "longitude": self.lon_deg,
            "altitude": self.alt_m,
        }  # fmt: skip


@dataclass(frozen=True)
class VehicleMission:
    """The mission of one vehicle.

    Attributes:
        home: Where it starts.
        items: What it does, without home.
    """

    home: Home
    items: tuple[MissionItem, ...]

    def numbered(self, *, home_first: bool) -> list[MissionItem]:
        """Return the items as a vehicle numbers them; with `home_first`, item 0 is home."""
        if not home_first:
            return list(self.items)
        lat_deg, lon_deg, alt_m = self.home
        home = MissionItem(
            NAV_WAYPOINT, FRAME_GLOBAL, lat_deg=lat_deg, lon_deg=lon_deg, alt_m=alt_m
        )
        return [home, *self.items]


def check_item(item: MissionItem, where: str) -> None:
    """Raise if an item's place is not on the Earth, or another of its numbers is infinite.

    Raises:
        ValueError: One line that starts with `where`.
    """
    limits = {} if item.frame == FRAME_MISSION else _LIMITS
    for name, value in item.numbers.items():
        if name in limits and not abs(value) <= limits[name]:
            limit = limits[name]
            raise ValueError(f"{where}: {name} must be {-limit:g} to {limit:g}, got {value!r}")
        if math.isinf(value):
            raise ValueError(f"{where}: {name} must be a number, got {value!r}")

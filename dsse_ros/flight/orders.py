# SPDX-License-Identifier: Apache-2.0
"""What a vehicle can be told to do; altitudes are metres above its home."""

from __future__ import annotations

import math
from dataclasses import dataclass

from dsse_ros.flight.mission_messages import WireItem

_MAX_ALT_M = 1e5


@dataclass(frozen=True)
class TakeOff:
    """Arm if that is allowed, climb straight up; in the air, climb or descend on the spot.

    Raises:
        ValueError: If the altitude is not above home.
    """

    alt_m: float

    def __post_init__(self) -> None:
        _check("alt_m", self.alt_m, 0.0, _MAX_ALT_M)
        if self.alt_m == 0:
            raise ValueError("alt_m: 0 is not allowed; more than 0")


@dataclass(frozen=True)
class GoTo:
    """Fly to a place and stay there.

    Attributes:
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_m: Altitude above home.
        radius_m: Horizontal distance at which the vehicle is there.

    Raises:
        ValueError: If it is no place on Earth, or the radius is not above 0.
    """

    lat_deg: float
    lon_deg: float
    alt_m: float
    radius_m: float

    def __post_init__(self) -> None:
        _check_place(self.lat_deg, self.lon_deg, self.alt_m, self.radius_m)


@dataclass(frozen=True)
class Search:
    """Fly to a place, descend, hold and climb back.

    Attributes:
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_m: Altitude above home before and after.
        search_alt_m: Altitude above home of the hold.
        hold_s: How long to hold there, in the vehicle's own time.
        radius_m: Horizontal distance at which the vehicle is there.

    Raises:
        ValueError: If it is no place on Earth, or a number is not allowed.
    """

    lat_deg: float
    lon_deg: float
    alt_m: float
    search_alt_m: float
    hold_s: float
    radius_m: float

    def __post_init__(self) -> None:
        _check_place(self.lat_deg, self.lon_deg, self.alt_m, self.radius_m)
        _check("search_alt_m", self.search_alt_m, -_MAX_ALT_M, _MAX_ALT_M)
        _check("hold_s", self.hold_s, 0.0, 3600.0)


@dataclass(frozen=True)
class Hold:
    """Stop and stay in the air."""


@dataclass(frozen=True)
class Return:
    """Fly home and land there, as the autopilot does it."""


@dataclass(frozen=True)
class Land:
    """Land on the spot."""


@dataclass(frozen=True)
class FlyMission:
    """Upload a mission, read it back, and fly it from its first item to its last.

    Attributes:
        items: The mission, numbered as the vehicle does: with ArduPilot item 0 is home.

    Raises:
        ValueError: If it is empty or not numbered from 0.
    """

    items: tuple[WireItem, ...]

    def __post_init__(self) -> None:
        if not self.items:
            raise ValueError("items: none is not allowed; at least one")
        for index, item in enumerate(self.items):
            if item.seq != index:
                raise ValueError(f"items[{index}].seq: {item.seq} is not allowed; {index} is")


Order = TakeOff | GoTo | Search | Hold | Return | Land | FlyMission
"""What a vehicle can be told to do."""


def _check(name: str, value: float, least: float, most: float) -> None:
    if not (math.isfinite(value) and least <= value <= most):
        raise ValueError(f"{name}: {value!r} is not allowed; {least:g} to {most:g}")


def _check_place(lat_deg: float, lon_deg: float, alt_m: float, radius_m: float) -> None:
    _check("lat_deg", lat_deg, -90.0, 90.0)
    _check("lon_deg", lon_deg, -180.0, 180.0)
    _check("alt_m", alt_m, -_MAX_ALT_M, _MAX_ALT_M)
    _check("radius_m", radius_m, 0.0, 1e6)
    if radius_m == 0:
        raise ValueError("radius_m: 0 is not allowed; more than 0")

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The fence: where the bridge may send vehicles, the search area with a margin and altitude limits.

The bridge checks every place and every mission item here first, and never sends a refused one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from msg_adapters.frames import GridFrame, map_to_cell
from msg_adapters.geodesy import geodetic_to_map, map_to_geodetic, on_near_side
from msg_adapters.mission_items import (
    FIRMWARES,
    FRAME_GLOBAL,
    FRAME_GLOBAL_RELATIVE_ALT,
    FRAME_MISSION,
    NAV_LAND,
    NAV_LOITER_TIME,
    NAV_RETURN_TO_LAUNCH,
    NAV_TAKEOFF,
    NAV_WAYPOINT,
    Home,
    MissionItem,
)
from msg_adapters.result import Accepted, Rejected, Result

_PLACED = (NAV_WAYPOINT, NAV_LOITER_TIME, NAV_LAND, NAV_TAKEOFF)
_MAX_PARAMETER = 1e6


@dataclass(frozen=True)
class Fence:
    """The volume in which vehicles may be.

    Attributes:
        frame: The grid, which is the search area.
        margin_m: How far around the area, and around home, vehicles may go.
        min_alt_m: Lowest altitude above home; landing and home itself are below it.
        max_alt_m: Highest altitude above home.
        center: Latitude and longitude of the middle of a circle that vehicles must not leave,
            whichever search they follow; None for no circle.
        radius_m: Radius of the circle.
        home: Where the vehicle starts, if not in the area.
        area: The cells of the grid to search, as in `AgentsInfo`; None for all.

    Raises:
        ValueError: If the margin or the altitude limits are not allowed.
    """

    frame: GridFrame
    margin_m: float
    min_alt_m: float
    max_alt_m: float
    center: tuple[float, float] | None = None
    radius_m: float = math.inf
    home: Home | None = None
    area: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.margin_m <= 1e6:
            raise ValueError(f"margin_m: {self.margin_m!r} is not allowed; 0 to 1e6")
        if not 0 <= self.min_alt_m <= self.max_alt_m <= 1e5:
            raise ValueError(
                f"min_alt_m, max_alt_m: {self.min_alt_m!r}, {self.max_alt_m!r} is not allowed; "
                "0 <= min_alt_m <= max_alt_m <= 1e5"
            )


Place = tuple[float, float, float]
"""Latitude and longitude in degrees and altitude above home in metres."""


def check_place(lat_deg: float, lon_deg: float, alt_m: float, fence: Fence) -> Result[Place]:
    """Check a place that a vehicle should fly to, with its altitude above home.

    Returns:
        The place, or `not_finite`, `not_on_earth`, `outside_fence` or `altitude`.
    """
    checked = check_take_off(lat_deg, lon_deg, alt_m, fence)
    if isinstance(checked, Rejected):
        return checked
    return _check_area(lat_deg, lon_deg, fence) or checked


def check_take_off(lat_deg: float, lon_deg: float, alt_m: float, fence: Fence) -> Result[Place]:
    """Check a place that a vehicle should take off to; it need not be in a cell to search.

    Returns:
        The place, or a rejection as from `check_place`.
    """
    refused = _check_horizontal(lat_deg, lon_deg, fence) or _check_altitude(
        alt_m, fence.min_alt_m, fence
    )
    return refused or Accepted((lat_deg, lon_deg, alt_m))


def check_item(item: MissionItem, fence: Fence) -> Result[MissionItem]:
    """Check an item that should be sent to a vehicle.

    Altitudes must be above home: the height of any other kind depends on sea level or the ground.

    Returns:
        The item, or `unknown_command`, `unknown_frame`, `not_finite`, `bad_parameter`,
        `not_on_earth`, `outside_fence` or `altitude`.
    """
    refused = _check_parameters(item)
    if refused:
        return refused
    if item.command not in (*_PLACED, NAV_RETURN_TO_LAUNCH):
        return Rejected(
            "unknown_command",
            f"command: {item.command} is not allowed; take-off, waypoint, hold, land or return",
        )
    placeless = item.command == NAV_RETURN_TO_LAUNCH
    if item.frame != FRAME_GLOBAL_RELATIVE_ALT and not (placeless and item.frame == FRAME_MISSION):
        return Rejected(
            "unknown_frame",
            f"frame: {item.frame} is not allowed; {FRAME_GLOBAL_RELATIVE_ALT}, above home, is",
        )
    if placeless:
        return Accepted(item)
    lowest_m = 0.0 if item.command == NAV_LAND else fence.min_alt_m
    refused = _check_horizontal(item.lat_deg, item.lon_deg, fence) or _check_altitude(
        item.alt_m, lowest_m, fence
    )
    if item.command in (NAV_WAYPOINT, NAV_LOITER_TIME):
        refused = refused or _check_area(item.lat_deg, item.lon_deg, fence)
    return refused or Accepted(item)


def check_mission(
    items: Sequence[MissionItem], fence: Fence, firmware: str
) -> Result[tuple[MissionItem, ...]]:
    """Check every item of a mission, which is numbered like the missions of its vehicle.

    Returns:
        The mission, or the rejection of its first refused item, see `check_item`.
    """
    for index, item in enumerate(items):
        is_home = index == 0 and FIRMWARES[firmware].home_first
        checked = _check_home(item, fence) if is_home else check_item(item, fence)
        if isinstance(checked, Rejected):
            return Rejected(checked.code, f"item {index}: {checked.reason}")
    return Accepted(tuple(items))


def _check_home(item: MissionItem, fence: Fence) -> Result[MissionItem]:
    if item.command != NAV_WAYPOINT:
        return Rejected(
            "unknown_command", f"command: {item.command} is not allowed for home; a waypoint is"
        )
    if item.frame != FRAME_GLOBAL:
        return Rejected(
            "unknown_frame",
            f"frame: {item.frame} is not allowed for home; {FRAME_GLOBAL}, above the sea, is",
        )
    refused = _check_parameters(item) or _check_horizontal(item.lat_deg, item.lon_deg, fence)
    return refused or Accepted(item)


def _check_parameters(item: MissionItem) -> Rejected | None:
    for name in ("param1", "param2", "param3", "param4"):
        value = getattr(item, name)
        # NaN as the yaw lets the autopilot choose it.
        if math.isnan(value) and name == "param4" and item.command in _PLACED:
            continue
        if not math.isfinite(value):
            return Rejected("not_finite", f"{name}: {value!r} is not allowed; a finite number")
        if abs(value) > _MAX_PARAMETER:
            return Rejected(
                "bad_parameter", f"{name}: {value!r} is not allowed; up to {_MAX_PARAMETER:g}"
            )
    for name in ("lat_deg", "lon_deg", "alt_m"):
        value = getattr(item, name)
        if not math.isfinite(value):
            return Rejected("not_finite", f"{name}: {value!r} is not allowed; a finite number")
    return None


def _check_horizontal(lat_deg: float, lon_deg: float, fence: Fence) -> Rejected | None:
    for name, value, limit in (("lat_deg", lat_deg, 90.0), ("lon_deg", lon_deg, 180.0)):
        if not math.isfinite(value):
            return Rejected("not_finite", f"{name}: {value!r} is not allowed; a finite number")
        if abs(value) > limit:
            return Rejected(
                "not_on_earth", f"{name}: {value!r} is not allowed; {-limit:g} to {limit:g}"
            )
    frame, margin_m = fence.frame, fence.margin_m
    x_m, y_m, _ = geodetic_to_map(frame, lat_deg, lon_deg, frame.origin_alt_m)
    side_m = frame.grid_size * frame.cell_size_m
    in_area = all(-margin_m <= value <= side_m + margin_m for value in (x_m, y_m))
    near = on_near_side(frame, lat_deg, lon_deg)
    if near and not in_circle(lat_deg, lon_deg, fence):
        assert fence.center is not None
        middle = "({:.7f}, {:.7f})".format(*fence.center)
        return Rejected(
            "outside_fence",
            f"({lat_deg:.7f}, {lon_deg:.7f}) is not allowed; within {fence.radius_m:g} m of "
            f"{middle}, the middle of the fence",
        )
    if near and (in_area or _near_home(x_m, y_m, fence)):
        return None
    return Rejected(
        "outside_fence",
        f"({lat_deg:.7f}, {lon_deg:.7f}) is not allowed; within {margin_m:g} m of the search area",
    )


def in_circle(lat_deg: float, lon_deg: float, fence: Fence) -> bool:
    """Return whether a place is in the circle of the fence."""
    if fence.center is None:
        return True
    frame = fence.frame
    place, middle = (
        geodetic_to_map(frame, *one, frame.origin_alt_m)[:2]
        for one in ((lat_deg, lon_deg), fence.center)
    )
    return math.dist(place, middle) <= fence.radius_m


def check_search(fence: Fence) -> str:
    """Return why the search area does not lie in the circle of the fence; empty if it does."""
    frame = fence.frame
    side_m = frame.grid_size * frame.cell_size_m
    for x_m in (0.0, side_m):
        for y_m in (0.0, side_m):
            lat_deg, lon_deg, _ = map_to_geodetic(frame, x_m, y_m, 0.0)
            near = on_near_side(frame, *(fence.center or (lat_deg, lon_deg)))
            if not (near and in_circle(lat_deg, lon_deg, fence)):
                assert fence.center is not None
                middle = "({:.7f}, {:.7f})".format(*fence.center)
                return (
                    f"fence_radius: {fence.radius_m:g} is not allowed; the search area reaches "
                    f"further from the middle of the fence, {middle}"
                )
    return ""


def _check_area(lat_deg: float, lon_deg: float, fence: Fence) -> Rejected | None:
    """Reject a place in a cell that is not to be searched; None if the vehicle may go there."""
    frame = fence.frame
    if fence.area is None:
        return None
    x_m, y_m, _ = geodetic_to_map(frame, lat_deg, lon_deg, frame.origin_alt_m)
    cell = map_to_cell(frame, x_m, y_m)
    if cell is None or fence.area[cell[1]][cell[0]] == "1":
        return None
    return Rejected(
        "outside_fence",
        f"({lat_deg:.7f}, {lon_deg:.7f}), in cell {list(cell)}, is not allowed; a cell of the area "
        "that is searched",
    )


def _near_home(x_m: float, y_m: float, fence: Fence) -> bool:
    if fence.home is None:
        return False
    frame = fence.frame
    home_x_m, home_y_m, _ = geodetic_to_map(
        frame, fence.home.lat_deg, fence.home.lon_deg, frame.origin_alt_m
    )
    return math.hypot(x_m - home_x_m, y_m - home_y_m) <= fence.margin_m


def _check_altitude(alt_m: float, lowest_m: float, fence: Fence) -> Rejected | None:
    if not math.isfinite(alt_m):
        return Rejected("not_finite", f"alt_m: {alt_m!r} is not allowed; a finite number")
    if not lowest_m <= alt_m <= fence.max_alt_m:
        return Rejected(
            "altitude",
            f"alt_m: {alt_m!r} is not allowed; {lowest_m:g} to {fence.max_alt_m:g} above home",
        )
    return None

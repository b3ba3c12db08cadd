# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The fence: where the bridge may send vehicles, the search area with a margin and altitude limits.

The bridge checks every place and every mission item here first, and never sends a refused one.
Altitudes are above mean sea level.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

from dsse_ros.base.checks import check_number
from dsse_ros.base.result import Accepted, Rejected, Result
from dsse_ros.vehicles.mission_items.items import (
    FRAME_GLOBAL,
    FRAME_MISSION,
    NAV_TAKEOFF,
    NAV_WAYPOINT,
    PLACELESS,
    MissionItem,
)
from dsse_ros.world.scenario.frames import GridFrame, map_to_cell
from dsse_ros.world.scenario.geodesy import geodetic_to_map, map_to_geodetic, on_near_side

_PLACED = (NAV_WAYPOINT, NAV_TAKEOFF)
_MAX_PARAMETER = 1e6
_MAX_ALT_M = 1e5


@dataclass(frozen=True)
class Fence:
    """The volume in which vehicles may be.

    Attributes:
        frame: The grid, which is the search area.
        margin_m: How far around the area vehicles may go.
        min_amsl_m: Lowest altitude; landing and home itself are below it.
        max_amsl_m: Highest altitude.
        center: Latitude and longitude of the middle of a circle that vehicles must not leave,
            whichever search they follow; None for no circle.
        radius_m: Radius of the circle.
        area: The cells of the grid to search, as in `AgentsInfo`; None for all.

    Raises:
        ValueError: If the margin or the altitude limits are not allowed.
    """

    frame: GridFrame
    margin_m: float
    min_amsl_m: float
    max_amsl_m: float
    center: tuple[float, float] | None = None
    radius_m: float = math.inf
    area: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        check_number("margin_m", self.margin_m, 0, 1e6)
        check_number("max_amsl_m", self.max_amsl_m, -_MAX_ALT_M, _MAX_ALT_M)
        check_number("min_amsl_m", self.min_amsl_m, -_MAX_ALT_M, self.max_amsl_m)


Place = tuple[float, float, float]
"""Latitude and longitude in degrees and altitude above mean sea level in metres."""


def check_place(lat_deg: float, lon_deg: float, alt_amsl_m: float, fence: Fence) -> Result[Place]:
    """Check a place that a vehicle should fly to.

    Returns:
        The place, or `not_finite`, `not_on_earth`, `outside_fence` or `altitude`.
    """
    checked = check_take_off(lat_deg, lon_deg, alt_amsl_m, fence)
    if isinstance(checked, Rejected):
        return checked
    return _check_area(lat_deg, lon_deg, fence) or checked


def check_take_off(
    lat_deg: float, lon_deg: float, alt_amsl_m: float, fence: Fence
) -> Result[Place]:
    """Check a place that a vehicle should take off to; it need not be in a cell to search.

    Returns:
        The place, or a rejection as from `check_place`.
    """
    refused = check_horizontal(lat_deg, lon_deg, fence) or _check_altitude(alt_amsl_m, fence)
    return refused or Accepted((lat_deg, lon_deg, alt_amsl_m))


def check_item(item: MissionItem, fence: Fence) -> Result[MissionItem]:
    """Check an item that should be sent to a vehicle.

    Altitudes must be above the sea: a home, and the ground, may be anywhere.

    Returns:
        The item, or `unknown_command`, `unknown_frame`, `not_finite`, `bad_parameter`,
        `not_on_earth`, `outside_fence` or `altitude`.
    """
    refused = _check_parameters(item)
    if refused:
        return refused
    placeless = item.command in PLACELESS
    if not placeless and item.command not in _PLACED:
        return Rejected(
            "unknown_command",
            f"command must be take-off, speed, waypoint or return, got {item.command}",
        )
    if item.frame != (FRAME_MISSION if placeless else FRAME_GLOBAL):
        wanted = f"{FRAME_MISSION}" if placeless else f"{FRAME_GLOBAL}, above the sea"
        return Rejected("unknown_frame", f"frame must be {wanted}, got {item.frame}")
    if placeless:
        return Accepted(item)
    check = check_take_off if item.command == NAV_TAKEOFF else check_place
    checked = check(item.lat_deg, item.lon_deg, item.alt_m, fence)
    return checked if isinstance(checked, Rejected) else Accepted(item)


def check_mission(
    items: Sequence[MissionItem], fence: Fence, *, home_first: bool
) -> Result[tuple[MissionItem, ...]]:
    """Check every item of a mission, which is numbered as `VehicleMission.numbered` does.

    Returns:
        The mission, or the rejection of its first refused item, see `check_item`.
    """
    for index, item in enumerate(items):
        is_home = index == 0 and home_first
        checked = _check_home(item, fence) if is_home else check_item(item, fence)
        if isinstance(checked, Rejected):
            return Rejected(checked.code, f"item {index}: {checked.reason}")
    return Accepted(tuple(items))


def check_search(fence: Fence) -> str | None:
    """Return why the search area does not lie in the circle of the fence."""
    frame, center = fence.frame, fence.center
    width_m, height_m = frame.extent
    for x_m, y_m in itertools.product((0.0, width_m), (0.0, height_m)):
        lat_deg, lon_deg, _ = map_to_geodetic(frame, x_m, y_m, 0.0)
        if center and not (on_near_side(frame, *center) and _in_circle(lat_deg, lon_deg, fence)):
            return (
                "fence_radius must cover the search area from the middle of the fence, "
                f"{_shown(*center)}, got {fence.radius_m:g}"
            )
    return None


def _check_home(item: MissionItem, fence: Fence) -> Rejected | None:
    if item.command != NAV_WAYPOINT:
        return Rejected(
            "unknown_command", f"command must be a waypoint for home, got {item.command}"
        )
    if item.frame != FRAME_GLOBAL:
        wanted = f"{FRAME_GLOBAL}, above the sea, for home"
        return Rejected("unknown_frame", f"frame must be {wanted}, got {item.frame}")
    return _check_parameters(item) or check_horizontal(item.lat_deg, item.lon_deg, fence)


def _check_parameters(item: MissionItem) -> Rejected | None:
    limits = dict.fromkeys(("param1", "param2", "param3", "param4"), _MAX_PARAMETER)
    if math.isnan(item.param4) and item.command in _PLACED:
        # NaN as the yaw lets the autopilot choose it.
        del limits["param4"]
    limits |= dict.fromkeys(("lat_deg", "lon_deg", "alt_m"), math.inf)
    for name, limit in limits.items():
        refused = _check_limits("bad_parameter", name, getattr(item, name), -limit, limit)
        if refused:
            return refused
    return None


def check_horizontal(lat_deg: float, lon_deg: float, fence: Fence) -> Rejected | None:
    """Reject a place outside the fence, at any altitude; None if it is inside."""
    refused = _check_limits("not_on_earth", "lat_deg", lat_deg, -90.0, 90.0) or _check_limits(
        "not_on_earth", "lon_deg", lon_deg, -180.0, 180.0
    )
    if refused:
        return refused
    frame, margin_m = fence.frame, fence.margin_m
    near = on_near_side(frame, lat_deg, lon_deg)
    if near and fence.center and not _in_circle(lat_deg, lon_deg, fence):
        where = f"{fence.radius_m:g} m of {_shown(*fence.center)}, the middle of the fence"
    else:
        where = f"{margin_m:g} m of the search area"
        x_m, y_m, _ = geodetic_to_map(frame, lat_deg, lon_deg, frame.origin_alt_m)
        within = zip((x_m, y_m), frame.extent, strict=True)
        if near and all(-margin_m <= value <= side_m + margin_m for value, side_m in within):
            return None
    return Rejected(
        "outside_fence", f"place must be within {where}, got {_shown(lat_deg, lon_deg)}"
    )


def _in_circle(lat_deg: float, lon_deg: float, fence: Fence) -> bool:
    frame = fence.frame
    place, middle = (
        geodetic_to_map(frame, *lat_lon, frame.origin_alt_m)[:2]
        for lat_lon in ((lat_deg, lon_deg), fence.center or (lat_deg, lon_deg))
    )
    return math.dist(place, middle) <= fence.radius_m


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
        "place must be in a cell of the area that is searched, got "
        f"{_shown(lat_deg, lon_deg)} in cell {list(cell)}",
    )


def _check_altitude(alt_amsl_m: float, fence: Fence) -> Rejected | None:
    limits = (fence.min_amsl_m, fence.max_amsl_m)
    return _check_limits("altitude", "altitude", alt_amsl_m, *limits, " m above the sea")


def _check_limits(
    code: str, name: str, value: float, least: float, most: float, unit: str = ""
) -> Rejected | None:
    if not math.isfinite(value):
        return Rejected("not_finite", f"{name} must be a finite number, got {value!r}")
    if not least <= value <= most:
        return Rejected(code, f"{name} must be {least:g} to {most:g}{unit}, got {value!r}")
    return None


def _shown(lat_deg: float, lon_deg: float) -> str:
    return f"({lat_deg:.7f}, {lon_deg:.7f})"

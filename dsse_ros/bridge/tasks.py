# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tasks of a vehicle: for a leg of its drone, or for its whole track, within the fence."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dsse_ros.autopilots import Autopilot
from dsse_ros.bridge.fence import Fence, check_mission, check_place
from dsse_ros.bridge.vehicle_missions import FlightSettings
from dsse_ros.flight.orders import FlyMission, FlyTrack, GoTo, Search
from dsse_ros.flight.paced_setpoint import AHEAD_M, BRAKING_MPS2, Place
from dsse_ros.flight.vehicle_controller import Order
from dsse_ros.flight.vehicle_state import VehicleState
from dsse_ros.mission_items.items import NAV_WAYPOINT, VehicleMission
from dsse_ros.mission_items.track_missions import Leg, acceptance_radius_m
from dsse_ros.result import Accepted, Rejected, Result
from dsse_ros.scenario.frames import GridFrame
from dsse_ros.scenario.geodesy import between, cell_to_geodetic, map_to_geodetic, offset_m

Task = tuple[Order, ...]
"""Orders, one after the other."""
_OVER_HOME_M = 15.0
_STANDS_M = 1.0
"""Length of a way up to which the vehicle stays where it is."""
_OVERRUN_S = 3.0
"""Time in which a vehicle that can hover would fly from the end of a track to the place behind it
at which it stops; that is farther if it needs the way to brake."""


def leg_task(
    leg: Leg, frame: GridFrame, settings: FlightSettings, fence: Fence, datum_m: float
) -> Result[Task]:
    """Return the task of a vehicle for a leg, or why the vehicle may not fly it.

    Its last order is to be at the cell's centre, at flight altitude.

    Args:
        leg: The leg.
        frame: The grid, at the vehicle's flight altitude above the datum.
        settings: How to fly the leg.
        fence: Where the vehicle may be.
        datum_m: Altitude of the datum above mean sea level.
    """
    lat_deg, lon_deg, _ = cell_to_geodetic(frame, *leg.cell, frame.alt_m)
    top_m = datum_m + frame.alt_m
    low_m = datum_m + min(settings.search_altitude, frame.alt_m) if leg.searched else top_m
    for alt_m in (top_m, low_m):
        checked = check_place(lat_deg, lon_deg, alt_m, fence)
        if isinstance(checked, Rejected):
            return checked
    radius_m = acceptance_radius_m(frame, settings.acceptance_radius)
    there = GoTo(lat_deg, lon_deg, top_m, radius_m)
    if not leg.searched:
        return Accepted((there,))
    search = Search(lat_deg, lon_deg, top_m, low_m, settings.search_hold, radius_m)
    return Accepted((search, there))


def way_task(
    leg: Leg,
    frame: GridFrame,
    settings: FlightSettings,
    fence: Fence,
    top_m: float,
    step_s: float,
    *,
    circles: bool,
) -> Result[Task]:
    """Return the task of a vehicle for a leg in metres, or why the vehicle may not fly it.

    The vehicle flies on behind the end of a track only where the fence allows it.

    Args:
        leg: The leg, with a way.
        frame: The grid.
        settings: How to fly the leg.
        fence: Where the vehicle may be.
        top_m: Altitude of the vehicle's layer above mean sea level.
        step_s: Time in which the way is to be flown.
        circles: See `Autopilot`.
    """
    x_m, y_m = np.array(leg.way).T
    lats, lons, _ = map_to_geodetic(frame, x_m, y_m, frame.alt_m)
    places = tuple(zip(lats.tolist(), lons.tolist(), strict=True))
    for lat_deg, lon_deg in places:
        checked = check_place(lat_deg, lon_deg, top_m, fence)
        if isinstance(checked, Rejected):
            return checked
    length_m = sum(math.dist(a, b) for a, b in itertools.pairwise(leg.way))
    if length_m < _STANDS_M:
        return Accepted((GoTo(*places[-1], top_m, settings.acceptance_radius),))
    speed_mps = length_m / step_s
    overrun_m = speed_mps * max(_OVERRUN_S, speed_mps / (2.0 * BRAKING_MPS2))
    beyond = _beyond(places, AHEAD_M if circles else overrun_m)
    if isinstance(check_place(*beyond, top_m, fence), Rejected):
        beyond = places[-1]
    return Accepted((FlyTrack(places, beyond, top_m, speed_mps),))


def _beyond(places: Sequence[Place], metres: float) -> Place:
    """Return the place behind the end of a track, in the direction of its last leg."""
    end = places[-1]
    start = next(place for place in reversed(places) if place != end)
    return between(start, end, 1.0 + metres / math.hypot(*offset_m(start, end)))


def mission_task(
    mission: VehicleMission, fence: Fence, autopilot: Autopilot, *, holds_over_home: bool = False
) -> Result[Task]:
    """Return the order to fly a mission, or why the vehicle may not fly it.

    Args:
        mission: The mission.
        fence: Where the vehicle may be.
        autopilot: Autopilot of the vehicle.
        holds_over_home: Whether the second to last item is a hold over home.
    """
    items = mission.numbered(home_first=autopilot.home_first)
    checked = check_mission(items, fence, home_first=autopilot.home_first)
    if isinstance(checked, Rejected):
        return checked
    if not autopilot.keeps_item_radius:
        # This autopilot has one radius for all waypoints, and reads items back with a radius of 0.
        items = [
            replace(item, param2=0.0) if item.command == NAV_WAYPOINT else item for item in items
        ]
    hold_item = len(items) - 2 if holds_over_home else -1
    return Accepted((FlyMission(tuple(items), hold_item=hold_item),))


def waits_over_home(order: Order | None, state: VehicleState, autopilot: Autopilot) -> bool:
    """Return whether a vehicle has flown its mission except for the landing.

    Args:
        order: The order of its task that is due.
        state: What it reports.
        autopilot: Autopilot of the vehicle.
    """
    if not isinstance(order, FlyMission) or order.hold_item < 0 or not state.has_position:
        return False
    if state.mode != autopilot.mission_mode:
        # The item stays the current one if a person ends the mission.
        return False
    item = order.items[order.hold_item]
    away = offset_m((state.lat_deg, state.lon_deg), (item.lat_deg, item.lon_deg))
    return state.item_current == order.hold_item and math.hypot(*away) <= _OVER_HOME_M

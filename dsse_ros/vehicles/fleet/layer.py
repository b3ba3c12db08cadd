# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The layer of a vehicle in a search: its altitude and its fence, and so what it may fly."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsse_ros.base.result import Accepted, Rejected, Result
from dsse_ros.vehicles.autopilots import AUTOPILOTS, Autopilot
from dsse_ros.vehicles.control.orders import FlyMission, FlyTrack, GoTo, SearchPlace
from dsse_ros.vehicles.control.paced_setpoint import AHEAD_M, BRAKING_MPS2, Place
from dsse_ros.vehicles.control.vehicle_controller import Order
from dsse_ros.vehicles.control.vehicle_state import VehicleState
from dsse_ros.vehicles.fleet.fence import Fence, check_mission, check_place, check_take_off
from dsse_ros.vehicles.fleet.settings import BridgeSettings
from dsse_ros.vehicles.mission_items.items import NAV_WAYPOINT, VehicleMission
from dsse_ros.vehicles.mission_items.track_missions import VehicleLeg, acceptance_radius_m
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import between, cell_to_geodetic, map_to_geodetic, offset_m

Task = tuple[Order, ...]
"""Orders, one after the other."""
_OVER_HOME_M = 5.0
"""Distance from home at which a vehicle may come down: it would climb first if it were farther."""
_STANDS_M = 1.0
"""Length of a way up to which the vehicle stays where it is."""
_OVERRUN_S = 3.0
"""Time in which a vehicle that can hover would fly from the end of a track to the place behind it
at which it stops; that is farther if it needs the way to brake."""


@dataclass(frozen=True)
class Layer:
    """Where a vehicle flies, and the tasks that it may fly there.

    Attributes:
        fence: Where it may be; the altitude of the fence's grid is the layer's above the datum.
        settings: How it is flown.
        step_s: Time of a step, in which a way in metres is to be flown.
        speed_mps: Planned airspeed in metres; 0 on cells.
    """

    fence: Fence
    settings: BridgeSettings
    step_s: float
    speed_mps: float = 0.0

    @property
    def frame(self) -> GridFrame:
        """The grid at its altitude above the datum."""
        return self.fence.frame

    @property
    def top_amsl_m(self) -> float:
        """Its altitude above mean sea level."""
        return self.settings.datum_altitude + self.frame.alt_m

    @property
    def autopilot(self) -> Autopilot:
        """Autopilot of the vehicle."""
        return AUTOPILOTS[self.settings.autopilot]

    def leg_task(self, leg: VehicleLeg) -> Result[Task]:
        """Return the task of the vehicle for a leg, or why the vehicle may not fly it.

        Its last order is to be at the end of the leg, at the altitude of the layer.
        """
        return self._track_task(leg.way) if leg.way else self._cell_task(leg)

    def _cell_task(self, leg: VehicleLeg) -> Result[Task]:
        frame, settings, top_m = self.frame, self.settings, self.top_amsl_m
        lat_deg, lon_deg, _ = cell_to_geodetic(frame, *leg.cell, frame.alt_m)
        low_m = settings.datum_altitude + min(settings.search_altitude, frame.alt_m)
        for alt_m in (top_m, low_m if leg.searched else top_m):
            checked = check_place(lat_deg, lon_deg, alt_m, self.fence)
            if isinstance(checked, Rejected):
                return checked
        radius_m = acceptance_radius_m(frame, settings.acceptance_radius)
        there = GoTo(lat_deg, lon_deg, top_m, radius_m)
        if not leg.searched:
            return Accepted((there,))
        search = SearchPlace(lat_deg, lon_deg, top_m, low_m, settings.search_hold, radius_m)
        return Accepted((search, there))

    def _track_task(self, way: Sequence[tuple[float, float]]) -> Result[Task]:
        """Return the task for a way; behind its end the vehicle stays in the fence too."""
        top_m, x_m, y_m = self.top_amsl_m, *np.array(way).T
        lats, lons, _ = map_to_geodetic(self.frame, x_m, y_m, self.frame.alt_m)
        places = tuple(zip(lats.tolist(), lons.tolist(), strict=True))
        for lat_deg, lon_deg in places:
            checked = check_place(lat_deg, lon_deg, top_m, self.fence)
            if isinstance(checked, Rejected):
                return checked
        length_m = sum(math.dist(a, b) for a, b in itertools.pairwise(way))
        if length_m < _STANDS_M:
            return Accepted((GoTo(*places[-1], top_m, self.settings.acceptance_radius),))
        speed_mps = length_m / self.step_s
        overrun_m = speed_mps * max(_OVERRUN_S, speed_mps / (2.0 * BRAKING_MPS2))
        beyond = _beyond(places, AHEAD_M if self.autopilot.circles else overrun_m)
        if isinstance(check_place(*beyond, top_m, self.fence), Rejected):
            beyond = places[-1]
        return Accepted((FlyTrack(places, beyond, top_m, speed_mps),))

    def mission_task(
        self, mission: VehicleMission, *, holds_over_home: bool = False
    ) -> Result[Task]:
        """Return the order to fly a mission, or why the vehicle may not fly it.

        Args:
            mission: The mission.
            holds_over_home: Whether the second to last item is a hold over home.
        """
        autopilot = self.autopilot
        items = mission.numbered(home_first=autopilot.home_first)
        checked = check_mission(items, self.fence, home_first=autopilot.home_first)
        if isinstance(checked, Rejected):
            return checked
        if not autopilot.keeps_item_radius:
            # It has one radius for all waypoints, and reads items back with a radius of 0.
            items = [
                replace(item, param2=0.0) if item.command == NAV_WAYPOINT else item
                for item in items
            ]
        hold_item = len(items) - 2 if holds_over_home else -1
        return Accepted((FlyMission(tuple(items), hold_item=hold_item),))

    def way_home(self, state: VehicleState) -> GoTo | None:
        """Return the way home in the layer; None if home is unknown or not allowed."""
        if state.home is None:
            return None
        lat_deg, lon_deg, _ = state.home
        if isinstance(check_take_off(lat_deg, lon_deg, self.top_amsl_m, self.fence), Rejected):
            return None
        most_m = min(self.settings.acceptance_radius, _OVER_HOME_M)
        return GoTo(lat_deg, lon_deg, self.top_amsl_m, acceptance_radius_m(self.frame, most_m))


def _beyond(places: Sequence[Place], metres: float) -> Place:
    """Return the place behind the end of a track, in the direction of its last leg."""
    end = places[-1]
    start = next(place for place in reversed(places) if place != end)
    return between(start, end, 1.0 + metres / math.hypot(*offset_m(start, end)))

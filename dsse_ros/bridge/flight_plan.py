# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The flight plan of a search: the altitude, the fence and the tasks of each vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from dsse_ros.autopilots import AUTOPILOTS
from dsse_ros.bridge.fence import Fence, check_search, check_take_off
from dsse_ros.bridge.settings import BridgeSettings
from dsse_ros.bridge.tasks import Task, leg_task, mission_task, way_task
from dsse_ros.bridge.vehicle_missions import Track, layers, search_missions
from dsse_ros.flight.orders import GoTo
from dsse_ros.flight.vehicle_state import VehicleState
from dsse_ros.mission_items.items import Home
from dsse_ros.mission_items.reduced_tracks import without_repeats
from dsse_ros.mission_items.separation import Space, place_of, track_spaces
from dsse_ros.mission_items.track_missions import Leg, acceptance_radius_m
from dsse_ros.result import Rejected, Result
from dsse_ros.scenario.agents import AgentsInfo
from dsse_ros.scenario.fields import FieldError
from dsse_ros.scenario.frames import GridFrame
from dsse_ros.scenario.geodesy import map_to_geodetic

HOME_HOLD_S = 600.0
"""Time for which a vehicle on a mission waits over home for those below, if nobody lands it."""

OVER_HOME_M = 5.0
"""Distance from home at which a vehicle may come down: it would climb first if it were farther."""


@dataclass(frozen=True)
class MissionPlan:
    """The mission of one vehicle.

    Attributes:
        task: The order to fly the mission, or why the vehicle may not fly it.
        spaces: The space that the mission needs, without climb and landing.
    """

    task: Result[Task]
    spaces: tuple[Space, ...]


class FlightPlan:
    """Altitudes, fences and tasks of the vehicles in a search.

    Args:
        settings: How to fly the vehicles.
        info: The search.
        center: Latitude and longitude of the middle of the fence; None for the middle of this
            search.

    Attributes:
        frames: The grid at the altitude of each vehicle above the datum.
        datum_m: Altitude of the datum above mean sea level.
        center: Latitude and longitude of the middle of the fence.

    Raises:
        FieldError: If the vehicles do not all fit between the allowed altitudes, cannot hover over
            the search's cells, or the search does not lie in the fence.
    """

    def __init__(
        self, settings: BridgeSettings, info: AgentsInfo, center: tuple[float, float] | None
    ) -> None:
        if info.actions and AUTOPILOTS[settings.autopilot].circles:
            raise FieldError(
                f"autopilot must be one that hovers with space cells, got {settings.autopilot!r}"
            )
        self._settings = settings
        self._area, self._step_s = info.area, info.step_duration_s
        self.datum_m = settings.datum_altitude
        self.frames = layered(info.frame, settings, len(info.agents))
        self.center = _middle(info.frame) if center is None else center
        trouble = check_search(self.fence(0))
        if trouble:
            raise FieldError(trouble)

    def fence(self, i: int) -> Fence:
        """Return the fence of a vehicle."""
        settings = self._settings
        return Fence(
            self.frames[i],
            settings.fence_margin,
            settings.datum_altitude + settings.min_altitude,
            settings.datum_altitude + settings.max_altitude,
            center=self.center,
            radius_m=settings.fence_radius,
            area=self._area,
        )

    def top_amsl_m(self, i: int) -> float:
        """Return the altitude of a vehicle's layer above mean sea level."""
        return self.datum_m + self.frames[i].alt_m

    def leg_task(self, i: int, leg: Leg) -> Result[Task]:
        """Return the task of a vehicle for a leg, or why the vehicle may not fly it."""
        frame, fence = self.frames[i], self.fence(i)
        if leg.way:
            top_m = self.top_amsl_m(i)
            circles = AUTOPILOTS[self._settings.autopilot].circles
            return way_task(leg, frame, self._settings, fence, top_m, self._step_s, circles=circles)
        return leg_task(leg, frame, self._settings, fence, self.datum_m)

    def missions(
        self, tracks: Mapping[int, Track], homes: Mapping[int, tuple[float, float, float]]
    ) -> dict[int, MissionPlan]:
        """Return the missions of these vehicles, for their tracks and homes.

        If there are several, each holds over home at its end until the others are out of its way.
        """
        flown = list(tracks)
        several = len(flown) > 1
        frames, places = [self.frames[i] for i in flown], [Home(*homes[i]) for i in flown]
        missions = search_missions(
            frames, [tracks[i] for i in flown], self._settings, places,
            HOME_HOLD_S if several else 0.0, self.datum_m,
        )  # fmt: skip
        autopilot = AUTOPILOTS[self._settings.autopilot]
        plans = {}
        for i, frame, home, mission in zip(flown, frames, places, missions, strict=True):
            path = [tuple(cell) for cell in without_repeats(tracks[i][0]).tolist()]
            spaces = track_spaces(frame, path, place_of(frame, home.lat_deg, home.lon_deg))
            task = mission_task(mission, self.fence(i), autopilot, holds_over_home=several)
            # The spaces contain no descents: a mission has none where another vehicle passes below.
            plans[i] = MissionPlan(task, tuple(spaces))
        return plans

    def way_home(self, i: int, state: VehicleState) -> GoTo | None:
        """Return the way home at a vehicle's altitude; None if home is unknown or not allowed."""
        if state.home is None:
            return None
        lat_deg, lon_deg, _ = state.home
        top_m = self.top_amsl_m(i)
        if isinstance(check_take_off(lat_deg, lon_deg, top_m, self.fence(i)), Rejected):
            return None
        most_m = min(self._settings.acceptance_radius, OVER_HOME_M)
        return GoTo(lat_deg, lon_deg, top_m, acceptance_radius_m(self.frames[i], most_m))


def layered(frame: GridFrame, settings: BridgeSettings, vehicles: int) -> list[GridFrame]:
    """Return the grid at the altitude of each vehicle.

    Raises:
        FieldError: If the vehicles do not all fit between the allowed altitudes.
    """
    if len(settings.altitudes) == vehicles:
        return [replace(frame, alt_m=alt_m) for alt_m in settings.altitudes]
    highest = replace(frame, alt_m=settings.altitudes[0]) if settings.altitudes else frame
    return layers(highest, settings, vehicles, settings.min_altitude)


def _middle(frame: GridFrame) -> tuple[float, float]:
    half_m = frame.side_m / 2
    lat_deg, lon_deg, _ = map_to_geodetic(frame, half_m, half_m, 0.0)
    return lat_deg, lon_deg

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a search means for each vehicle: its altitude, its fence, and its tasks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from dsse_ros.bridge.fence import Fence, check_search, check_take_off
from dsse_ros.bridge.settings import BridgeSettings
from dsse_ros.bridge.tasks import Task, leg_task, mission_task
from dsse_ros.flight.autopilots import AUTOPILOTS
from dsse_ros.flight.orders import GoTo
from dsse_ros.flight.vehicle_state import VehicleState
from dsse_ros.mission.vehicle_missions import Track, layers, search_missions
from dsse_ros.scenario.fields import FieldError
from msg_adapters.agents import AgentsInfo
from msg_adapters.frames import GridFrame
from msg_adapters.geodesy import map_to_geodetic
from msg_adapters.mission_items import Home
from msg_adapters.result import Rejected, Result
from msg_adapters.separation import Space, place_of, track_spaces
from msg_adapters.track_missions import Leg, acceptance_radius_m
from msg_adapters.tracks import without_repeats

HOME_HOLD_S = 600.0
"""How long a vehicle on a mission waits over home for those below it, if nobody lands it."""


@dataclass(frozen=True)
class MissionPlan:
    """The mission of one vehicle.

    Attributes:
        task: The order to fly it, or why it may not be flown.
        spaces: The space that it takes, without climb and landing.
    """

    task: Result[Task]
    spaces: tuple[Space, ...]


class FlightPlan:
    """Altitudes, fences and tasks of the vehicles in a search.

    Args:
        settings: How vehicles are flown.
        info: The search.
        center: Latitude and longitude of the middle of the fence; None to anchor it here.

    Attributes:
        frames: The grid at the altitude of each vehicle.
        center: Latitude and longitude of the middle of the fence.

    Raises:
        FieldError: If there is not room for all vehicles between the altitudes that are allowed, or
            the search does not lie in the fence.
    """

    def __init__(
        self, settings: BridgeSettings, info: AgentsInfo, center: tuple[float, float] | None
    ) -> None:
        self._settings = settings
        self._area = info.area
        self.frames = layered(info.frame, settings, len(info.agents))
        self.center = _middle(info.frame) if center is None else center
        trouble = check_search(self.fence(0))
        if trouble:
            raise FieldError(trouble)

    def fence(self, i: int) -> Fence:
        """Return where a vehicle may be."""
        settings = self._settings
        return Fence(
            self.frames[i],
            settings.fence_margin,
            settings.min_altitude,
            settings.max_altitude,
            center=self.center,
            radius_m=settings.fence_radius,
            area=self._area,
        )

    def leg_task(self, i: int, leg: Leg, state: VehicleState) -> Result[Task]:
        """Return what a vehicle has to do for a leg, or why it may not."""
        frame, fence = self.frames[i], self.fence(i)
        if state.flying and state.has_position:
            # From elsewhere it would fly there across what is not in the fence.
            here = check_take_off(state.lat_deg, state.lon_deg, frame.alt_m, fence)
            if isinstance(here, Rejected):
                return Rejected(here.code, f"it is elsewhere: {here.reason}")
        return leg_task(leg, frame, self._settings, fence)

    def missions(
        self, tracks: Mapping[int, Track], homes: Mapping[int, tuple[float, float, float]]
    ) -> dict[int, MissionPlan]:
        """Return the missions of these vehicles, for their tracks and homes.

        Of several each holds over home at its end, for the others to be out of its way.
        """
        flown = list(tracks)
        several = len(flown) > 1
        frames, places = [self.frames[i] for i in flown], [Home(*homes[i]) for i in flown]
        missions = search_missions(
            frames, [tracks[i] for i in flown], self._settings, places,
            HOME_HOLD_S if several else 0.0,
        )  # fmt: skip
        autopilot = AUTOPILOTS[self._settings.autopilot]
        plans = {}
        for i, frame, home, mission in zip(flown, frames, places, missions, strict=True):
            path = [tuple(cell) for cell in without_repeats(tracks[i][0]).tolist()]
            spaces = track_spaces(frame, path, place_of(frame, home.lat_deg, home.lon_deg))
            task = mission_task(mission, self.fence(i), autopilot, holds_over_home=several)
            # Where it descends nobody passes below.
            plans[i] = MissionPlan(task, tuple(spaces))
        return plans

    def way_home(self, i: int, state: VehicleState) -> GoTo | None:
        """Return the way home at a vehicle's altitude; None if home is not known or not allowed."""
        if state.home is None:
            return None
        lat_deg, lon_deg, _ = state.home
        frame = self.frames[i]
        if isinstance(check_take_off(lat_deg, lon_deg, frame.alt_m, self.fence(i)), Rejected):
            return None
        radius_m = acceptance_radius_m(frame, self._settings.acceptance_radius)
        return GoTo(lat_deg, lon_deg, frame.alt_m, radius_m)


def layered(frame: GridFrame, settings: BridgeSettings, vehicles: int) -> list[GridFrame]:
    """Return the grid at the altitude of each vehicle.

    Raises:
        FieldError: If there is not room for all between the altitudes that are allowed.
    """
    if len(settings.altitudes) == vehicles:
        return [replace(frame, alt_m=alt_m) for alt_m in settings.altitudes]
    highest = replace(frame, alt_m=settings.altitudes[0]) if settings.altitudes else frame
    return layers(highest, settings, vehicles, settings.min_altitude)


def _middle(frame: GridFrame) -> tuple[float, float]:
    half_m = frame.grid_size * frame.cell_size_m / 2
    lat_deg, lon_deg, _ = map_to_geodetic(frame, half_m, half_m, 0.0)
    return lat_deg, lon_deg

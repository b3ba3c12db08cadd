# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The flight plan of a search: the layer and the mission of each vehicle."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace

from dsse_ros.base.fields import FieldError
from dsse_ros.base.result import Result
from dsse_ros.vehicles.autopilots import AUTOPILOTS
from dsse_ros.vehicles.fleet.fence import Fence, check_search
from dsse_ros.vehicles.fleet.layer import Layer, Task
from dsse_ros.vehicles.fleet.settings import BridgeSettings
from dsse_ros.vehicles.fleet.vehicle_missions import Track, layers, search_missions
from dsse_ros.vehicles.mission_items.items import Home
from dsse_ros.vehicles.mission_items.reduced_tracks import without_repeats
from dsse_ros.vehicles.mission_items.separation import MIN_GAP_M, Space, place_of, track_spaces
from dsse_ros.world.scenario.agents import AgentsInfo
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import map_to_geodetic

HOME_HOLD_S = 600.0
"""Time for which a vehicle on a mission waits over home for those below, if nobody lands it."""
_ROUNDING_M = 1e-6


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
    """Layers and missions of the vehicles in a search.

    Args:
        settings: How to fly the vehicles.
        info: The search.
        center: Latitude and longitude of the middle of the fence; None for the middle of this
            search.

    Attributes:
        layers: The layer of each vehicle.
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
        self.datum_m = settings.datum_altitude
        self.center = _middle(info.frame) if center is None else center
        frames = layered(info.frame, settings, len(info.agents))
        speeds = info.speeds_mps or (0.0,) * len(frames)
        self.layers = [
            Layer(self._fence(frame, info.area), settings, info.step_duration_s, speed_mps)
            for frame, speed_mps in zip(frames, speeds, strict=True)
        ]
        trouble = check_search(self.layers[0].fence)
        if trouble:
            raise FieldError(trouble)

    def _fence(self, frame: GridFrame, area: tuple[str, ...] | None) -> Fence:
        settings = self._settings
        return Fence(
            frame,
            settings.fence_margin,
            self.datum_m + settings.min_altitude,
            self.datum_m + settings.max_altitude,
            center=self.center,
            radius_m=settings.fence_radius,
            area=area,
        )

    def missions(
        self, tracks: Mapping[int, Track], homes: Mapping[int, tuple[float, float, float]]
    ) -> dict[int, MissionPlan]:
        """Return the missions of these vehicles, for their tracks and homes.

        If there are several, each holds over home at its end until the others are out of its way.
        """
        flown = list(tracks)
        several = len(flown) > 1
        flown_layers = [self.layers[i] for i in flown]
        frames, places = [layer.frame for layer in flown_layers], [Home(*homes[i]) for i in flown]
        missions = search_missions(
            frames, [tracks[i] for i in flown], self._settings, places,
            [self._settings.speed] * len(flown), HOME_HOLD_S if several else 0.0, self.datum_m,
        )  # fmt: skip
        plans = {}
        for i, layer, home, mission in zip(flown, flown_layers, places, missions, strict=True):
            path = [tuple(cell) for cell in without_repeats(tracks[i][0]).tolist()]
            spaces = track_spaces(layer.frame, path, place_of(layer.frame, *home[:2]))
            task = layer.mission_task(mission, holds_over_home=several)
            # The spaces contain no descents: a mission has none where another vehicle passes below.
            plans[i] = MissionPlan(task, tuple(spaces))
        return plans


def layered(frame: GridFrame, settings: BridgeSettings, vehicles: int) -> list[GridFrame]:
    """Return the grid at the altitude of each vehicle.

    Raises:
        FieldError: If the vehicles do not all fit between the allowed altitudes, or two layers are
            so near that vehicles in both would be in each other's way.
    """
    if len(settings.altitudes) == vehicles:
        frames = [replace(frame, alt_m=alt_m) for alt_m in settings.altitudes]
        name = "altitudes"
    else:
        highest = replace(frame, alt_m=settings.altitudes[0]) if settings.altitudes else frame
        frames = layers(highest, settings, vehicles, settings.min_altitude)
        name = "altitude_step"
    for low_m, high_m in itertools.pairwise(sorted(layer.alt_m for layer in frames)):
        if 0.0 < high_m - low_m < MIN_GAP_M - _ROUNDING_M:
            raise FieldError(
                f"{name} must put vehicles at one altitude or {MIN_GAP_M:g} m apart, got "
                f"{low_m:g} and {high_m:g} m for {vehicles} vehicles"
            )
    return frames


def _middle(frame: GridFrame) -> tuple[float, float]:
    width_m, height_m = frame.extent
    lat_deg, lon_deg, _ = map_to_geodetic(frame, width_m / 2, height_m / 2, 0.0)
    return lat_deg, lon_deg

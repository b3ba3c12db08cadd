# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Goals of drones in metres that somebody waits for, see `navigation`."""

from __future__ import annotations

from typing import Any, TypeVar

from dsse_ros.mission.flight_mission import FlightMission
from dsse_ros.mission.mission import Mission
from dsse_ros.mission.navigation import Navigation
from dsse_ros.mission.track_follower import way_left
from dsse_ros.search.flights import wind_of

T = TypeVar("T")


class FlightNavigation(Navigation[T]):
    """A `Navigation` of drones that fly straight to their goals.

    Args:
        mission: The mission.
    """

    def __init__(self, mission: FlightMission) -> None:
        super().__init__(mission)
        self._flights = mission

    def _is_there(self, drone: int, goal: Any) -> bool:
        commands = self._flights.commands
        return commands.goal_of(drone) is goal and commands.track_of(drone) is None

    def _way_left(self, drone: int, goal: Any) -> tuple[float, float]:
        mission = self._flights
        track, flown = mission.commands.track_of(drone), mission.result.flown
        assert flown is not None
        if track is None:
            return 0.0, 0.0
        flyer, wind = mission.commands.flyers[drone], wind_of(mission.env.scenario)
        return way_left(track, flown.flights[drone], flyer, wind)


def navigation_of(mission: Mission) -> Navigation[Any]:
    """Return the goals of a mission, in metres a `FlightNavigation`."""
    if isinstance(mission, FlightMission):
        return FlightNavigation(mission)
    return Navigation(mission)

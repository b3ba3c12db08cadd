# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Wind, current and shore around the search of an incident, for people to see."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.drift.flow import SENSE, Flow, Kind, speed_and_direction
from dsse_ros.drift.kernels import read_flow
from dsse_ros.scenario.area import Area, cell_centre
from dsse_ros.scenario.geodesy import Origin, surface_to_geodetic
from dsse_ros.scenario.incident_grid import metres_from

if TYPE_CHECKING:
    from dsse_ros.scenario.scenario import ResolvedScenario

Velocity = tuple[float, float]
"""To the east and to the north in m/s."""


class SeaFlow(NamedTuple):
    """Wind or current in the terms of each.

    Attributes:
        kind: Which of them.
        velocity_mps: To where it flows.
        sense: `from` or `toward`, how its direction is stated.
        speed_mps: Its speed.
        direction_deg: Its direction, clockwise from north.
    """

    kind: Kind
    velocity_mps: Velocity
    sense: str
    speed_mps: float
    direction_deg: float


class SeaState(NamedTuple):
    """The sea around a search.

    Attributes:
        wind_mps: Velocity of the air at the datum of the search's start; None if unknown.
        current_mps: Velocity of the water there; None if unknown.
        shore: Rings (K, 2) of the land in metres to the east and to the north of the grid's
            south-west corner; the last point is joined to the first.
    """

    wind_mps: Velocity | None = None
    current_mps: Velocity | None = None
    shore: tuple[NDArray[np.float64], ...] = ()

    @property
    def flows(self) -> list[SeaFlow]:
        """Wind and current, as far as they are known."""
        known: tuple[tuple[Kind, Velocity | None], ...] = (
            ("wind", self.wind_mps),
            ("current", self.current_mps),
        )
        return [
            SeaFlow(kind, velocity, SENSE[kind], *speed_and_direction(kind, *velocity))
            for kind, velocity in known
            if velocity is not None
        ]


def sea_state(scenario: ResolvedScenario, step: int) -> SeaState:
    """Return the sea of a scenario after some steps of its search; without an incident, nothing."""
    incident = scenario.incident
    if incident is None or incident.laid is None or incident.given is not None:
        return SeaState()
    origin = (scenario.origin_lat, scenario.origin_lon, scenario.origin_alt)
    centre = cell_centre(scenario.grid_size, scenario.cell_size, *scenario.person_initial_position)
    lat, lon = surface_to_geodetic(origin, *centre)
    time_s = incident.laid.begins_s + step * scenario.step_duration_s
    shore = () if incident.land is None else _rings(incident.land, origin)
    return SeaState(
        _velocity(incident.wind, lat, lon, time_s),
        _velocity(incident.current, lat, lon, time_s),
        shore,
    )


def _velocity(flow: Flow, lat_deg: float, lon_deg: float, time_s: float) -> Velocity | None:
    east, north = read_flow(flow.arrays, float(lat_deg), float(lon_deg), time_s)
    return None if math.isnan(east) else (east, north)


@lru_cache(maxsize=4)
def _rings(land: Area, origin: Origin) -> tuple[NDArray[np.float64], ...]:
    return tuple(
        np.stack(metres_from(origin, *np.array(ring, np.float64).T), axis=1)
        for polygon in land.polygons
        for ring in polygon
    )

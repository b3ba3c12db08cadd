# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Wind, current, shore and sightings around the search of an incident, for people to see."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.world.drift.flow import SENSE, Flow, Kind, speed_and_direction, utc
from dsse_ros.world.drift.kernels import read_flow
from dsse_ros.world.drift.sightings import Seen, Sighting
from dsse_ros.world.scenario.area import Area
from dsse_ros.world.scenario.frames import cell_centre
from dsse_ros.world.scenario.geodesy import Origin, surface_to_geodetic
from dsse_ros.world.scenario.incident_grid import metres_from
from dsse_ros.world.scenario.while_alive import while_alive

if TYPE_CHECKING:
    from dsse_ros.world.scenario.incident import Incident
    from dsse_ros.world.scenario.scenario import ResolvedScenario

_KNOTS = 3600 / 1852
"""A metre per second in knots."""
Velocity = tuple[float, float]
"""To the east and to the north in m/s."""


class SeaFlow(NamedTuple):
    """Wind or current, with its direction as it is usually stated.

    Attributes:
        kind: Which of them.
        velocity_mps: Its velocity.
        sense: `from` or `toward`, how its direction is stated.
        speed_mps: Its speed.
        direction_deg: Its direction, clockwise from north.
    """

    kind: Kind
    velocity_mps: Velocity
    sense: str
    speed_mps: float
    direction_deg: float

    @property
    def label(self) -> str:
        """Speed and direction in words."""
        return (
            f"{self.kind} {self.speed_mps:.1f} m/s ({self.speed_mps * _KNOTS:.1f} kn) "
            f"{self.sense} {round(self.direction_deg) % 360:03d}°"
        )


class LastKnownPosition(NamedTuple):
    """A sighting on the map.

    Attributes:
        x_m: Metres to the east of the grid's south-west corner.
        y_m: Metres to the north of it.
        radius_m: The object was within this distance in 99 of 100 cases.
        label: What it is and the time in UTC, with its share among several.
        lines: Lines (K, 2) in the same metres: the outline of an area, or a voyage.
    """

    x_m: float
    y_m: float
    radius_m: float
    label: str
    lines: tuple[NDArray[np.float64], ...] = ()


class SeaState(NamedTuple):
    """The sea around a search.

    Attributes:
        wind_mps: Velocity of the air at the datum of the search's start; None if unknown.
        current_mps: Velocity of the water there; None if unknown.
        shore: Rings (K, 2) of the land in metres to the east and to the north of the grid's
            south-west corner; the last point is joined to the first.
        sightings: Where the object was seen.
        time: Time of day in UTC, "" if unknown.
    """

    wind_mps: Velocity | None = None
    current_mps: Velocity | None = None
    shore: tuple[NDArray[np.float64], ...] = ()
    sightings: tuple[LastKnownPosition, ...] = ()
    time: str = ""

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
    if incident is None or incident.grid_summary is None:
        return SeaState()
    time_s = incident.grid_summary.begins_s + step * scenario.step_duration_s
    time = _clock(time_s, incident)
    if incident.model_tracks is not None:
        return SeaState(time=time)
    origin = (scenario.origin_lat, scenario.origin_lon, scenario.origin_alt)
    centre = cell_centre(scenario.grid_size, scenario.cell_size, *scenario.person_initial_position)
    lat, lon = surface_to_geodetic(origin, *centre)
    return SeaState(
        _velocity(incident.wind, lat, lon, time_s),
        _velocity(incident.current, lat, lon, time_s),
        () if incident.land is None else _rings(incident.land, origin),
        _sightings(incident, origin),
        time,
    )


def _sightings(incident: Incident, origin: Origin) -> tuple[LastKnownPosition, ...]:
    seen = incident.sightings
    x, y = metres_from(origin, *np.array([sighting.place for sighting in seen]).T)
    total = sum(sighting.weight for sighting in seen)
    return tuple(
        LastKnownPosition(
            east, north, sighting.radius_m if isinstance(sighting, Sighting) else 0.0,
            f"{sighting.label} {_when(sighting, incident)}"
            + (f", {sighting.weight / total:.0%}" if len(seen) > 1 else ""),
            tuple(
                np.stack(metres_from(origin, *line), axis=1)
                for line in sighting.lines if len(line[0]) > 1
            ),
        )
        for sighting, east, north in zip(seen, x.tolist(), y.tolist(), strict=True)
    )  # fmt: skip


def _when(seen: Seen, incident: Incident) -> str:
    """Return when the object was seen; of an area, a voyage or a bearing from when to when."""
    if isinstance(seen, Sighting):
        return _clock(seen.time_s, incident)
    first, last = (_clock(time_s, incident) for time_s in (seen.first_s, seen.last_s))
    return first if first == last else f"{first} to {last}"


def _clock(time_s: float, incident: Incident) -> str:
    """Return a time of day in UTC, with the date if it is not that of the search's start."""
    date, _, time = utc(time_s).partition("T")
    day = "" if utc(incident.search_start_s).startswith(date) else f"{date} "
    return f"{day}{time[:5]}Z"


def _velocity(flow: Flow, lat_deg: float, lon_deg: float, time_s: float) -> Velocity | None:
    east, north = read_flow(flow.arrays, float(lat_deg), float(lon_deg), time_s)
    return None if math.isnan(east) else (east, north)


@while_alive
def _rings(land: Area, origin: Origin) -> tuple[NDArray[np.float64], ...]:
    return tuple(
        np.stack(metres_from(origin, *np.array(ring, np.float64).T), axis=1)
        for polygon in land.polygons
        for ring in polygon
    )

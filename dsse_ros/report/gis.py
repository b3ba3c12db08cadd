# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A recorded mission for geographic information systems: maps, tracks and places on the Earth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone

import numpy as np
from numpy.typing import NDArray

from dsse_ros.report.metrics import cumulative_pod
from dsse_ros.report.record import RecordedMission
from dsse_ros.scenario.frames import GridFrame, scenario_frame
from dsse_ros.scenario.geodesy import cell_to_geodetic
from dsse_ros.view.mission_view import MissionView


@dataclass(frozen=True, eq=False)
class GisMap:
    """The maps after a step.

    Attributes:
        step: Steps done.
        poc: (G, G) float32 [row, col], row 0 in the north: probability of containment.
        pod: (G, G) float32, POD of all looks at the cell so far, see `cumulative_pod`.
    """

    step: int
    poc: NDArray[np.float32]
    pod: NDArray[np.float32]


@dataclass(frozen=True)
class GisPoint:
    """A point of a track, or a place.

    Attributes:
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_m: Height above the sea.
        time: UTC; None if the scenario has no date.
        name: Name of a place.
    """

    lat_deg: float
    lon_deg: float
    alt_m: float = 0.0
    time: datetime | None = None
    name: str = ""


@dataclass(frozen=True)
class GisMission:
    """What the files contain.

    Attributes:
        title: Name of the scenario.
        frame: The grid.
        maps: Maps after chosen steps, in order.
        tracks: Positions of each drone in the search, one for each recorded step.
        places: Datum at the last map, and finds.
    """

    title: str
    frame: GridFrame
    maps: tuple[GisMap, ...]
    tracks: Mapping[str, tuple[GisPoint, ...]]
    places: tuple[GisPoint, ...]


def gis_mission(record: RecordedMission, shown: Mapping[int, MissionView]) -> GisMission:
    """Return a mission for GIS files.

    Args:
        record: The mission.
        shown: Its views at some recorded steps, 0 to K - 1, with the POC as probability.
    """
    scenario = record.scenario
    frame = scenario_frame(scenario)
    times = _times(record)
    tracks = {}
    for n, name in enumerate(record.agents):
        steps = np.flatnonzero(record.in_flight[:, n]).tolist()
        points = _points(frame, record.cells[steps, n], frame.alt_of(n))
        tracks[name] = tuple(
            GisPoint(lat, lon, alt, times[k])
            for k, (lat, lon, alt) in zip(steps, points, strict=True)
        )
    places = []
    last = shown[max(shown)]
    if last.datum is not None:
        lat, lon, _ = _points(frame, np.array([last.datum]), 0.0)[0]
        places.append(GisPoint(lat, lon, 0.0, times[max(shown)], "datum"))
    for k, n in np.argwhere(record.found).tolist():
        lat, lon, _ = _points(frame, record.cells[k, n : n + 1], 0.0)[0]
        places.append(GisPoint(lat, lon, 0.0, times[k], f"found by {record.agents[n]}"))
    maps = tuple(
        GisMap(view.step, view.probability, cumulative_pod(record, k + 1).astype(np.float32))
        for k, view in sorted(shown.items())
    )
    return GisMission(scenario.name or "Search mission", frame, maps, tracks, tuple(places))


def _times(record: RecordedMission) -> list[datetime | None]:
    """Return the time of each recorded step; only an incident has dates."""
    incident = record.scenario.incident
    if incident is None or incident.laid is None:
        return [None] * len(record.times_s)
    begin_s = incident.laid.begins_s
    times_s = begin_s + record.times_s
    return [datetime.fromtimestamp(time_s, timezone.utc) for time_s in times_s.tolist()]


def _points(
    frame: GridFrame, cells: NDArray[np.int64], alt_m: float
) -> list[tuple[float, float, float]]:
    """Return latitude, longitude and height above the sea of the centres of cells (M, 2)."""
    col, row = cells.T.astype(float)
    lat, lon, _ = cell_to_geodetic(frame, col, row, alt_m)
    return [(*point, alt_m) for point in zip(lat.tolist(), lon.tolist(), strict=True)]

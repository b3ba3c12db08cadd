# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A recorded mission for geographic information systems: maps, tracks and places on the Earth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.picture.map_axes import looked_runs
from dsse_ros.picture.mission_view import MissionView
from dsse_ros.results.report.metrics import cumulative_pod
from dsse_ros.results.report.record import RecordedMission
from dsse_ros.results.report.swept import Polygon, swept_polygons
from dsse_ros.search.environments.metres_drones import strips_of
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import cell_to_geodetic
from dsse_ros.world.scenario.scenario import scenario_frame


@dataclass(frozen=True, eq=False)
class GisMap:
    """The maps after a step.

    Attributes:
        step: Steps done.
        poc: (R, C) float32 [row, col], row 0 in the north: probability of containment.
        pod: (R, C) float32, POD of all looks at the cell so far, see `cumulative_pod`; None in
            metres.
    """

    step: int
    poc: NDArray[np.float32]
    pod: NDArray[np.float32] | None


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
        tracks: Positions of each drone in the search, one for each recorded step; in metres those
            on its paths.
        places: Datum at the last map, and finds.
        strips: What each drone in metres has searched, see `swept_polygons`; empty on cells.
        areas: What each drone is to search; empty without a plan.
    """

    title: str
    frame: GridFrame
    maps: tuple[GisMap, ...]
    tracks: Mapping[str, tuple[GisPoint, ...]]
    places: tuple[GisPoint, ...]
    strips: Mapping[str, tuple[Polygon, ...]]
    areas: Mapping[str, tuple[Polygon, ...]] = field(default_factory=dict)


def gis_mission(record: RecordedMission, shown: Mapping[int, MissionView]) -> GisMission:
    """Return a mission for GIS files.

    Args:
        shown: Its views at some recorded steps, 0 to K - 1, with the POC as probability.
    """
    scenario = record.scenario
    frame = scenario_frame(scenario)
    tracks, strips = {}, {}
    widths_m = strips_of(scenario) if record.in_cells is not None else ()
    seen = record.looked_on_tracks(len(record.steps))
    for n, name in enumerate(record.agents):
        track, times_s = _track(record, n)
        points = _points(frame, track, frame.alt_of(n))
        tracks[name] = tuple(
            GisPoint(lat, lon, alt, time)
            for (lat, lon, alt), time in zip(points, _times(record, times_s), strict=True)
        )
        if widths_m:
            looked = None if seen is None else seen[n, : len(track) - 1]
            strips[name] = swept_polygons(frame, looked_runs(track, looked), widths_m[n])
    places, times = [], _times(record, record.times_s)
    last = shown[max(shown)]
    if last.datum is not None:
        lat, lon, _ = _points(frame, np.array([last.datum]), 0.0)[0]
        places.append(GisPoint(lat, lon, 0.0, times[max(shown)], "datum"))
    for k, n in np.argwhere(record.found).tolist():
        lat, lon, _ = _points(frame, record.places[k, n : n + 1], 0.0)[0]
        places.append(GisPoint(lat, lon, 0.0, times[k], f"found by {record.agents[n]}"))
    maps = tuple(
        GisMap(view.step, view.probability, _pod(record, k + 1))
        for k, view in sorted(shown.items())
    )
    title = scenario.name or "Search mission"
    return GisMission(title, frame, maps, tracks, tuple(places), strips)


def _pod(record: RecordedMission, num_steps: int) -> NDArray[np.float32] | None:
    """Return the POD of each cell, which paths in metres do not have."""
    if record.in_cells is not None:
        return None
    return cumulative_pod(record, num_steps).astype(np.float32)


def _track(record: RecordedMission, drone: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the places (M, 2) (col, row) of a drone in the search, and their times (M,)."""
    steps = np.flatnonzero(record.in_flight[:, drone])
    if record.in_cells is None:
        return record.cells[steps, drone].astype(np.float64), record.times_s[steps]
    # A path has as many pieces of equal times; that of the start has none.
    flown = record.tracks(len(steps))[drone]
    pieces = (len(flown) - 1) // max(len(steps) - 1, 1)
    times_s = np.interp(
        np.arange(len(flown)) / max(pieces, 1), np.arange(len(steps)), record.times_s[steps]
    )
    return flown, times_s


def _times(record: RecordedMission, times_s: NDArray[np.float64]) -> list[datetime | None]:
    """Return times of the mission as dates, which only an incident has."""
    begins_s = record.scenario.begins_s
    if begins_s is None:
        return [None] * len(times_s)
    dates_s = (begins_s + times_s).tolist()
    return [datetime.fromtimestamp(date_s, timezone.utc) for date_s in dates_s]


def _points(
    frame: GridFrame, places: NDArray[Any], alt_m: float
) -> list[tuple[float, float, float]]:
    """Return latitude, longitude and height above the sea of places (M, 2) (col, row)."""
    col, row = places.T.astype(float)
    lat, lon, _ = cell_to_geodetic(frame, col, row, alt_m)
    return [(*point, alt_m) for point in zip(lat.tolist(), lon.tolist(), strict=True)]

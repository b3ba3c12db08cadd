# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drones' moves for vehicles: a leg for each step, and whole tracks as missions."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dsse_ros.mission_items.items import (
    FRAME_GLOBAL,
    FRAME_GLOBAL_RELATIVE_ALT,
    FRAME_MISSION,
    NAV_RETURN_TO_LAUNCH,
    NAV_TAKEOFF,
    NAV_WAYPOINT,
    Home,
    Mission,
    MissionItem,
)
from dsse_ros.mission_items.tracks import stops
from dsse_ros.scenario.frames import GridFrame
from dsse_ros.scenario.geodesy import cell_to_geodetic


@dataclass(frozen=True)
class Leg:
    """The leg of one drone's vehicle in a step.

    Attributes:
        stamp_ns: Stamp of the step's report.
        cell: (col, row) where the drone is now.
        searched: Whether it has searched there in this step.
        over: Whether its search is over.
        crashed: Whether that is because another drone is in its cell: no vehicle follows it there.
    """

    stamp_ns: int
    cell: tuple[int, int]
    searched: bool = False
    over: bool = False
    crashed: bool = False


def track_mission(
    frame: GridFrame,
    cells: ArrayLike,
    searched: ArrayLike | None = None,
    *,
    home: Home | None = None,
    merge_legs: bool = False,
    acceptance_radius_m: float = 0.0,
    search_alt_m: float = 30.0,
    search_hold_s: float = 5.0,
    level_cells: Collection[tuple[int, int]] = (),
    home_hold_s: float = 0.0,
    datum_amsl_m: float | None = None,
) -> Mission:
    """Return a track as a mission: take-off, waypoints, searches and the return.

    A search is a descent over its cell, a hold and a climb back to flight altitude: the drone
    "will descend and verify" (paper, section "Adopted simplications"), at an altitude and for a
    time that the paper leaves open. Searches of one cell in a row are one descent with the times
    added up.

    Args:
        frame: The grid; drones fly at its altitude.
        cells: (K, 2) of (col, row), one for each step and the start; consecutive equal cells are
            merged.
        searched: (K,) flags; index k says whether the drone came to be in `cells[k]` by searching
            it, and not by moving there. None for no search.
        home: Where the vehicle takes off; if not given, below the first cell of the track.
        merge_legs: Whether a straight leg is flown in one, without a waypoint in each cell.
        acceptance_radius_m: Distance at which a waypoint is reached; 0 for the autopilot's own.
        search_alt_m: Altitude of a search, not above the frame's.
        search_hold_s: Time that one search holds there.
        level_cells: Cells that are searched from flight altitude, without a descent.
        home_hold_s: Time to stay over home, at flight altitude, before the return; 0 for a return
            from where the track ends.
        datum_amsl_m: Altitude of the map plane above mean sea level; the items then have altitudes
            above the sea. If not given, they have altitudes above home, which is taken to lie on
            the map plane.

    Raises:
        ValueError: If the track is empty, shapes do not match or a number is not allowed.
    """
    track = np.asarray(cells).reshape(-1, 2)
    if len(track) == 0:
        raise ValueError("cells must be at least one cell, got an empty track")
    for name, value, most in (
        ("acceptance_radius_m", acceptance_radius_m, 255.0),
        ("search_alt_m", search_alt_m, frame.alt_m),
        ("search_hold_s", search_hold_s, 3600.0),
        ("home_hold_s", home_hold_s, 3600.0),
    ):
        if not 0 <= value <= most:
            raise ValueError(f"{name} must be 0 to {most:g}, got {value!r}")
    flags = np.zeros(len(track), dtype=bool) if searched is None else searched
    if home is None:
        col, row = track[0].tolist()
        home = Home(*cell_to_geodetic(frame, col, row, 0.0))

    over_home = datum_amsl_m is None
    alt_frame = FRAME_GLOBAL_RELATIVE_ALT if over_home else FRAME_GLOBAL
    datum_m = 0.0 if datum_amsl_m is None else datum_amsl_m

    def waypoint(lat_deg: float, lon_deg: float, alt_m: float, stay_s: float) -> MissionItem:
        return MissionItem(
            NAV_WAYPOINT,
            alt_frame,
            param1=float(stay_s),
            param2=float(acceptance_radius_m),
            param4=math.nan,
            lat_deg=lat_deg,
            lon_deg=lon_deg,
            alt_m=float(datum_m + alt_m),
        )

    def items() -> Iterator[MissionItem]:
        alt_m = frame.alt_m
        yield MissionItem(
            NAV_TAKEOFF, alt_frame,
            lat_deg=home.lat_deg, lon_deg=home.lon_deg, alt_m=datum_m + alt_m,
        )  # fmt: skip
        visited, searches = stops(track, flags, merge_legs=merge_legs)
        cols, rows = visited[:, 0].astype(float), visited[:, 1].astype(float)
        lats, lons, _ = cell_to_geodetic(frame, cols, rows, alt_m)
        visits = zip(visited.tolist(), lats.tolist(), lons.tolist(), searches.tolist(), strict=True)
        for cell, lat, lon, times in visits:
            level = times > 0 and tuple(cell) in level_cells
            yield waypoint(lat, lon, alt_m, times * search_hold_s if level else 0.0)
            if times and not level:
                yield waypoint(lat, lon, search_alt_m, times * search_hold_s)
                yield waypoint(lat, lon, alt_m, 0.0)
        if home_hold_s > 0:
            yield waypoint(home.lat_deg, home.lon_deg, alt_m, home_hold_s)
        yield MissionItem(NAV_RETURN_TO_LAUNCH, FRAME_MISSION)

    return Mission(home, tuple(items()))


def acceptance_radius_m(frame: GridFrame, most_m: float) -> float:
    """Return the distance from a cell's centre at which a vehicle is there, in no other cell."""
    return min(most_m, frame.cell_size_m / 2)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drones' moves for vehicles: a leg for each step, and whole tracks as missions."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsse_ros.base.checks import check_number
from dsse_ros.vehicles.mission_items.items import (
    DO_CHANGE_SPEED,
    FRAME_GLOBAL,
    FRAME_GLOBAL_RELATIVE_ALT,
    FRAME_MISSION,
    NAV_RETURN_TO_LAUNCH,
    NAV_TAKEOFF,
    NAV_WAYPOINT,
    Home,
    MissionItem,
    VehicleMission,
)
from dsse_ros.vehicles.mission_items.reduced_tracks import stops
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import cell_to_geodetic

_AIRSPEED, _GROUND_SPEED = 0.0, 1.0
"""MAVLink's SPEED_TYPE."""
_THROTTLE_UNCHANGED = -1.0
Way = tuple[tuple[float, float], ...]
"""Points (x, y) of the map frame, in metres."""


@dataclass(frozen=True)
class VehicleLeg:
    """The leg of one drone's vehicle.

    Attributes:
        number: Number of the task in `vehicle_tasks`; without these, the stamp of the step's report
            in nanoseconds.
        cell: (col, row) where the vehicle goes.
        searched: Whether the drone searches there.
        over: Whether its search is over.
        collided: Whether that is because another drone is in its cell: no vehicle follows it there.
        way: The points to fly along in a step of a search in metres, one point to stay at it; empty
            in a search on cells.
    """

    number: int
    cell: tuple[int, int]
    searched: bool = False
    over: bool = False
    collided: bool = False
    way: Way = ()

    def is_same(self, other: VehicleLeg) -> bool:
        """Return whether another leg is this one, even if only one of them is over."""
        return (self.number, self.cell, self.searched) == (other.number, other.cell, other.searched)


@dataclass(frozen=True)
class TrackStyle:
    """How a vehicle flies a track.

    Attributes:
        merge_legs: Whether a straight leg is flown in one, without a waypoint in each cell.
        acceptance_radius_m: Distance at which a waypoint is reached; 0 for the autopilot's own.
        search_alt_m: Altitude of a search, not above the frame's.
        search_hold_s: Time that one search holds there.
        home_hold_s: Time to stay over home, at flight altitude, before the return; 0 for a return
            from where the track ends.
        datum_amsl_m: Altitude of the map plane above mean sea level; the items then have altitudes
            above the sea. If not given, they have altitudes above home, which is taken to lie on
            the map plane.
        speed_mps: Speed that an item after the take-off sets; 0 for none, and the autopilot's own.
        airspeed: Whether that is an airspeed, not a ground speed.

    Raises:
        ValueError: If a number is not allowed.
    """

    merge_legs: bool = False
    acceptance_radius_m: float = 0.0
    search_alt_m: float = 30.0
    search_hold_s: float = 5.0
    home_hold_s: float = 0.0
    datum_amsl_m: float | None = None
    speed_mps: float = 0.0
    airspeed: bool = False

    def __post_init__(self) -> None:
        for name, most in (
            ("acceptance_radius_m", 255.0),
            ("search_alt_m", 1e6),
            ("search_hold_s", 3600.0),
            ("home_hold_s", 3600.0),
            ("speed_mps", 1000.0),
        ):
            check_number(name, getattr(self, name), 0.0, most)

    @property
    def alt_frame(self) -> int:
        """What the altitudes of the items are above."""
        return FRAME_GLOBAL_RELATIVE_ALT if self.datum_amsl_m is None else FRAME_GLOBAL

    def altitude_m(self, above_map_m: float) -> float:
        """Return an altitude above the map plane as the items have it."""
        return float((self.datum_amsl_m or 0.0) + above_map_m)

    def speed_items(self) -> list[MissionItem]:
        """Return the item that sets the speed, if one is to be set."""
        if not self.speed_mps:
            return []
        kind = _AIRSPEED if self.airspeed else _GROUND_SPEED
        numbers = (kind, float(self.speed_mps), _THROTTLE_UNCHANGED)
        return [MissionItem(DO_CHANGE_SPEED, FRAME_MISSION, *numbers)]

    def waypoint(
        self, lat_deg: float, lon_deg: float, above_map_m: float, stay_s: float = 0.0
    ) -> MissionItem:
        """Return a waypoint."""
        return MissionItem(
            NAV_WAYPOINT,
            self.alt_frame,
            param1=float(stay_s),
            param2=float(self.acceptance_radius_m),
            param4=math.nan,
            lat_deg=lat_deg,
            lon_deg=lon_deg,
            alt_m=self.altitude_m(above_map_m),
        )


def track_mission(
    frame: GridFrame,
    cells: ArrayLike,
    searched: ArrayLike | None = None,
    *,
    home: Home | None = None,
    level_cells: Collection[tuple[int, int]] = (),
    style: TrackStyle = TrackStyle(),
) -> VehicleMission:
    """Return a track as a mission: take-off, speed, waypoints, searches and the return.

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
        level_cells: Cells that are searched from flight altitude, without a descent.
        style: How the track is flown.

    Raises:
        ValueError: If the track is empty, shapes do not match or a search is above the frame's
            altitude.
    """
    track = np.asarray(cells).reshape(-1, 2)
    if len(track) == 0:
        raise ValueError("cells must be at least one cell, got an empty track")
    check_number("search_alt_m", style.search_alt_m, 0.0, frame.alt_m)
    flags = np.zeros(len(track), dtype=bool) if searched is None else searched
    if home is None:
        col, row = track[0].tolist()
        home = Home(*cell_to_geodetic(frame, col, row, 0.0))
    visited, searches = stops(track, flags, merge_legs=style.merge_legs)
    items = [
        MissionItem(
            NAV_TAKEOFF,
            style.alt_frame,
            lat_deg=home.lat_deg,
            lon_deg=home.lon_deg,
            alt_m=style.altitude_m(frame.alt_m),
        ),
        *style.speed_items(),
        *_visits(frame, visited, searches, level_cells, style),
    ]
    if style.home_hold_s > 0:
        items.append(style.waypoint(home.lat_deg, home.lon_deg, frame.alt_m, style.home_hold_s))
    return VehicleMission(home, (*items, MissionItem(NAV_RETURN_TO_LAUNCH, FRAME_MISSION)))


def _visits(
    frame: GridFrame,
    visited: NDArray[Any],
    searches: NDArray[np.int64],
    level_cells: Collection[tuple[int, int]],
    style: TrackStyle,
) -> Iterator[MissionItem]:
    """Yield the waypoints of the cells (K, 2) to fly to, each with its number of searches (K,)."""
    alt_m = frame.alt_m
    cols, rows = visited[:, 0].astype(float), visited[:, 1].astype(float)
    lats, lons, _ = cell_to_geodetic(frame, cols, rows, alt_m)
    visits = zip(visited.tolist(), lats.tolist(), lons.tolist(), searches.tolist(), strict=True)
    for cell, lat_deg, lon_deg, times in visits:
        hold_s = times * style.search_hold_s
        level = times > 0 and tuple(cell) in level_cells
        yield style.waypoint(lat_deg, lon_deg, alt_m, hold_s if level else 0.0)
        if times and not level:
            yield style.waypoint(lat_deg, lon_deg, style.search_alt_m, hold_s)
            yield style.waypoint(lat_deg, lon_deg, alt_m)


def acceptance_radius_m(frame: GridFrame, most_m: float) -> float:
    """Return the distance from a cell's centre at which a vehicle is there, in no other cell."""
    return min(most_m, frame.cell_size_m / 2)

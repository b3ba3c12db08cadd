# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether two vehicles could meet: the space that each takes, level by level, in the map frame."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from msg_adapters.frames import GridFrame, cell_to_map
from msg_adapters.geodesy import geodetic_to_map
from msg_adapters.mission_items import Home

Point = tuple[float, float]
"""x east and y north in the map frame, m."""
Cell = tuple[int, int]

SEPARATION_M = 30.0
"""Horizontal distance that is enough at any altitude, in cells of 60 m and more."""
MIN_GAP_M = 2.0
"""Difference in altitude that is enough over one place: each vehicle keeps its own to a metre."""


@dataclass(frozen=True)
class Space:
    """A straight leg, or a spot, between two altitudes.

    Attributes:
        start: Where it begins.
        end: Where it ends; the same for a spot.
        low_m: Lowest altitude above home.
        high_m: Highest altitude above home.
        home: Whether it is a spot where the vehicle takes off or lands.
    """

    start: Point
    end: Point
    low_m: float
    high_m: float
    home: bool = False


def spot(place: Point, low_m: float, high_m: float, *, home: bool = False) -> Space:
    """Return the space over a place between two altitudes, in any order."""
    return Space(place, place, min(low_m, high_m), max(low_m, high_m), home)


def leg(start: Point, end: Point, alt_m: float) -> Space:
    """Return the space of a level leg."""
    return Space(start, end, alt_m, alt_m)


def place_of(frame: GridFrame, lat_deg: float, lon_deg: float) -> Point:
    """Return a place on the Earth in the map frame."""
    x_m, y_m, _ = geodetic_to_map(frame, lat_deg, lon_deg, frame.origin_alt_m)
    return x_m, y_m


def separation_m(frame: GridFrame) -> float:
    """Return the horizontal distance that vehicles keep: neighbouring cells are apart."""
    return min(SEPARATION_M, frame.cell_size_m / 2)


def may_meet(
    ours: Iterable[Space], theirs: Sequence[Space], distance_m: float, homes_apart_m: float
) -> bool:
    """Return whether two vehicles could meet.

    Args:
        ours: Spaces of the one.
        theirs: Spaces of the other.
        distance_m: Horizontal distance that is enough.
        homes_apart_m: Distance between the places where the two take off: where one of them takes
            off or lands, they are no further apart anyway.
    """
    for one in ours:
        for other in theirs:
            limit_m = distance_m
            if one.home or other.home:
                # Positions are known to a metre or so.
                limit_m = min(limit_m, homes_apart_m - 1.0)
            low_m, high_m = max(one.low_m, other.low_m), min(one.high_m, other.high_m)
            if low_m - high_m < MIN_GAP_M and _apart_m(one, other) < limit_m:
                return True
    return False


def track_spaces(frame: GridFrame, cells: Sequence[Cell], home: Point | None) -> list[Space]:
    """Return the legs of a track from its way out to its way home.

    Args:
        frame: The grid, at the vehicle's altitude.
        cells: The cells that it flies over, in order; at least one.
        home: Where it takes off; None below its first cell.
    """
    places = [cell_to_map(frame, *cell) for cell in cells]
    home = places[0] if home is None else home
    places = [home, *places, home]
    return [leg(start, end, frame.alt_m) for start, end in zip(places, places[1:], strict=False)]


def level_cells(
    frames: Sequence[GridFrame],
    tracks: Sequence[Sequence[Cell]],
    searched: Sequence[Iterable[Cell]],
    homes: Sequence[Home | None],
) -> list[frozenset[Cell]]:
    """Return for each vehicle the cells that it has to search from its altitude, without a descent.

    Those are the cells over which a vehicle at the same altitude or a lower one passes at some
    time: when, depends on both.

    Args:
        frames: The grid at each vehicle's altitude.
        tracks: The cells of each, in order.
        searched: Those that each searches.
        homes: Where each takes off; None below its first cell.
    """
    spaces = []
    for frame, track, home in zip(frames, tracks, homes, strict=True):
        place = None if home is None else place_of(frame, home.lat_deg, home.lon_deg)
        spaces.append(track_spaces(frame, track, place) if track else [])
    found = []
    for i, (frame, cells) in enumerate(zip(frames, searched, strict=True)):
        below = [
            space
            for j, other in enumerate(frames)
            if j != i and other.alt_m <= frame.alt_m
            for space in spaces[j]
        ]
        limit_m = separation_m(frame)
        found.append(
            frozenset(
                cell
                for cell in set(cells)
                if any(
                    _apart_m(spot(cell_to_map(frame, *cell), 0.0, 0.0), space) < limit_m
                    for space in below
                )
            )
        )
    return found


def _apart_m(one: Space, other: Space) -> float:
    """Return the horizontal distance between two legs."""
    if _cross(one, other):
        return 0.0
    return min(
        _to_leg_m(one.start, other), _to_leg_m(one.end, other),
        _to_leg_m(other.start, one), _to_leg_m(other.end, one),
    )  # fmt: skip


def _to_leg_m(place: Point, space: Space) -> float:
    (x, y), (ax, ay), (bx, by) = place, space.start, space.end
    length2 = (bx - ax) ** 2 + (by - ay) ** 2
    share = 0.0 if length2 == 0 else ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length2
    share = min(max(share, 0.0), 1.0)
    return math.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay))


def _cross(one: Space, other: Space) -> bool:
    def side(a: Point, b: Point, c: Point) -> float:
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    a, b, c, d = one.start, one.end, other.start, other.end
    return side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Whether two vehicles could meet: the space that each takes, level by level, in the map frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.vehicles.mission_items.items import Home
from dsse_ros.world.scenario.frames import GridFrame, cell_to_map
from dsse_ros.world.scenario.geodesy import geodetic_to_map

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
        low_m: Lowest height above the datum of the layers.
        high_m: Highest height.
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


def places_of(frame: GridFrame, places: Sequence[Point]) -> list[Point]:
    """Return places on the Earth, latitudes and longitudes in degrees, in the map frame."""
    lats, lons = np.array(places, dtype=np.float64).reshape(-1, 2).T
    x_m, y_m, _ = geodetic_to_map(frame, lats, lons, frame.origin_alt_m)
    return list(zip(x_m.tolist(), y_m.tolist(), strict=True))


def separation_m(frame: GridFrame) -> float:
    """Return the horizontal distance that vehicles keep: neighbouring cells are apart."""
    return min(SEPARATION_M, frame.cell_size_m / 2)


def meetings(
    ours: NDArray[np.float64],
    theirs: NDArray[np.float64],
    distances_m: NDArray[np.float64],
    homes_apart_m: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Return in which spaces (M,) of others a vehicle could meet somebody.

    Args:
        ours: `rows_of` its own spaces (N, 7).
        theirs: `rows_of` those of the others (M, 7).
        distances_m: Horizontal distances (M,) that are enough.
        homes_apart_m: Distances (M,) between the places where the two take off: where one of them
            takes off or lands, they are no further apart anyway.
    """
    meet = np.zeros(len(theirs), dtype=bool)
    low_m = np.maximum(ours[:, None, _LOW], theirs[:, _LOW])
    high_m = np.minimum(ours[:, None, _HIGH], theirs[:, _HIGH])
    i, j = np.nonzero(low_m - high_m < MIN_GAP_M)
    if len(i):
        own, other = ours[i], theirs[j]
        at_home = (own[:, _HOME] > 0) | (other[:, _HOME] > 0)
        # Positions are known to a metre or so.
        least_m = np.minimum(distances_m, homes_apart_m - 1.0)[j]
        limits_m = np.where(at_home, least_m, distances_m[j])
        meet[j[_apart_m(own, other) < limits_m]] = True
    return meet


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

    Those are the cells over which a vehicle at the same altitude or a lower one passes, whenever
    that is: the time depends on both vehicles.

    Args:
        frames: The grid at each vehicle's altitude.
        tracks: The cells that each flies over, in order.
        searched: The cells that each searches.
        homes: Where each takes off; None below its first cell.
    """
    legs = []
    for frame, track, home in zip(frames, tracks, homes, strict=True):
        place = None if home is None else place_of(frame, home.lat_deg, home.lon_deg)
        # A vehicle flies many a leg more than once.
        legs.append(np.unique(rows_of(track_spaces(frame, track, place) if track else ()), axis=0))
    found = []
    for i, (frame, cells) in enumerate(zip(frames, searched, strict=True)):
        left = list(set(cells))
        limit_m = separation_m(frame)
        level: set[Cell] = set()
        for j, other in enumerate(frames):
            if j == i or other.alt_m > frame.alt_m or not left or not len(legs[j]):
                continue
            centers = np.array([cell_to_map(frame, *cell) for cell in left])
            away_m = _to_leg_m(centers[:, None], legs[j][:, _START], legs[j][:, _END])
            near: list[bool] = np.any(away_m < limit_m, axis=1).tolist()
            level.update(cell for cell, is_near in zip(left, near, strict=True) if is_near)
            left = [cell for cell, is_near in zip(left, near, strict=True) if not is_near]
        found.append(frozenset(level))
    return found


_START, _END, _LOW, _HIGH, _HOME = slice(0, 2), slice(2, 4), 4, 5, 6
"""Columns of `rows_of`."""


def rows_of(spaces: Iterable[Space]) -> NDArray[np.float64]:
    """Return spaces as an array (N, 7), for `meetings`."""
    rows = [(*space.start, *space.end, space.low_m, space.high_m, space.home) for space in spaces]
    return np.array(rows, dtype=np.float64).reshape(-1, 7)


def _apart_m(legs: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the horizontal distances (N,) between legs, row by row of `rows_of`."""
    a, b, c, d = legs[:, _START], legs[:, _END], other[:, _START], other[:, _END]
    ends_m = [_to_leg_m(a, c, d), _to_leg_m(b, c, d), _to_leg_m(c, a, b), _to_leg_m(d, a, b)]
    cross = (_side(a, b, c) * _side(a, b, d) < 0) & (_side(c, d, a) * _side(c, d, b) < 0)
    return np.where(cross, 0.0, np.minimum.reduce(ends_m))


def _to_leg_m(
    place: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[Any]:
    """Return the distances of places (..., 2) from legs."""
    along = end - start
    length2 = (along**2).sum(axis=-1)
    share = ((place - start) * along).sum(axis=-1) / np.where(length2 == 0, 1.0, length2)
    nearest = start + np.clip(share, 0.0, 1.0)[..., None] * along
    return np.hypot(*np.moveaxis(place - nearest, -1, 0))


def _side(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return on which side of the lines from a to b (N, 2) points c are: its sign."""
    (ax, ay), (bx, by), (cx, cy) = a.T, b.T, c.T
    side: NDArray[np.float64] = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    return side

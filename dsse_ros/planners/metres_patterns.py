# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Search patterns in metres about a datum that drifts, and the drones that fly them.

Tracks are polylines (K, 2) relative to the datum, to the east and to the south. See `patterns` for
the legs of the IAMSAR manual. Several drones share a pattern:

- sweep and creeping line: each has a block of adjacent lanes;
- expanding square: each has its arc of every square around the datum;
- sector: they take the triangles in turn;
- spiral: each has one of evenly rotated arms of an Archimedean spiral.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import count, islice
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.planners.patterns import (
    TRIANGLE_HEADINGS_DEG,
    SearchPattern,
    lane_legs,
    square_legs,
    triangle_legs,
    turning_points,
)
from dsse_ros.planners.planner import DrawsNothing
from dsse_ros.planners.sector import PATTERN_TURN_DEG
from dsse_ros.planners.sweep import split
from dsse_ros.search.step.metres_paths import Wind, pieces_of
from dsse_ros.search.step.metres_steering import steer
from dsse_ros.search.step.polylines import SAMPLES, along, goal_within_reach, nearest, points_at

Floats = NDArray[np.float64]

SECTOR_SIGMAS = 1.5
"""Radius of the first sector search, in standard deviations of the persons' positions."""


class Datum(NamedTuple):
    """Where the persons are expected at the start, and how they drift and spread.

    Attributes:
        position: (2,) float64, metres to the east and to the south of the grid's north-west corner.
        drift: (2,) float64, m/s.
        covariance: (2, 2) float64, of the persons' positions during the search, m^2.
    """

    position: Floats
    drift: Floats
    covariance: Floats

    def at(self, time_s: float | Floats) -> Floats:
        """Return its position after a time, (..., 2)."""
        return self.position + np.multiply.outer(time_s, self.drift)


class Layout(NamedTuple):
    """What a pattern is laid out for.

    Attributes:
        drones: Number of drones.
        spacing_m: Distance between adjacent tracks.
        length_m: Length of the track that a drone can fly.
        extent: Of the grid.
        covariance: Of `Datum`.
    """

    drones: int
    spacing_m: float
    length_m: float
    extent: GridExtent
    covariance: Floats


def to_south(points: Floats) -> Floats:
    """Return points (east, north) as (east, south), or the other way round."""
    return points * (1.0, -1.0)


def sweep_tracks(layout: Layout, creeping: bool = False) -> list[Floats]:
    """Return the tracks over a rectangle of as much area as the drones can search.

    Its sides are as long as the persons' spread along and across the greatest one. Lanes are along
    the greatest spread, or across it if they creep.
    """
    values, vectors = np.linalg.eigh(layout.covariance)
    ratio = math.sqrt(max(values[1], 1e-9) / max(values[0], 1e-9))
    spacing, area = layout.spacing_m, layout.drones * layout.length_m * layout.spacing_m
    longest = max(layout.extent)
    lane = min(math.sqrt(area / ratio if creeping else area * ratio), longest)
    lanes = min(math.ceil(area / lane / spacing), math.ceil(longest / spacing))
    lanes = max(lanes, layout.drones)
    start = -(lanes - 1) * spacing / 2, -lane / 2
    corners = to_south(np.array(turning_points(start, lane_legs(lanes, lane, spacing))))
    east, south = vectors[:, 0] if creeping else vectors[:, 1]
    points = corners @ np.array([(-south, east), (-east, -south)])
    return [points[2 * part.start : 2 * part.stop] for part in split(lanes, layout.drones)]


def square_tracks(layout: Layout) -> list[Floats]:
    """Return the tracks of an expanding square."""
    spacing, drones = layout.spacing_m, layout.drones
    if drones == 1:
        lanes = 2 + math.ceil(math.sqrt(layout.length_m / spacing))
        legs = (leg._replace(length=leg.length * spacing) for leg in square_legs(lanes))
        return [to_south(np.array(turning_points((0.0, 0.0), legs)))]
    rings = 1 + math.ceil(math.sqrt(layout.length_m * drones / spacing) / 2)
    tracks: list[list[Floats]] = [[] for _ in range(drones)]
    for ring in range(rings):
        for drone, track in enumerate(tracks):
            arc = square_arc((ring + 0.5) * spacing, drone / drones, (drone + 1) / drones)
            track.append(arc[::-1] if ring % 2 else arc)
    return [np.concatenate(track) for track in tracks]


def square_arc(half: float, first: float, last: float) -> Floats:
    """Return a part of the square with this half side, clockwise from its north-west corner.

    Args:
        half: Half of the side.
        first: Where the part begins, as a share of the circumference.
        last: Where it ends.
    """
    corners = half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)], float)
    shares = [first, *(k / 4 for k in range(5) if first < k / 4 < last), last]
    return np.stack([np.interp(shares, np.arange(5) / 4, corners[:, axis]) for axis in (0, 1)], 1)


def sector_tracks(layout: Layout) -> list[Floats]:
    """Return the tracks of a sector search; every second pattern fills the gaps of the last."""
    spread = math.sqrt(math.sqrt(max(float(np.linalg.det(layout.covariance)), 0.0)))
    radius = max(SECTOR_SIGMAS * spread, 2 * layout.spacing_m)
    triangles = max(math.ceil(layout.length_m / (3 * radius)), 1)
    corners = list(islice(_triangles(radius), layout.drones * triangles))
    return [np.concatenate(corners[n :: layout.drones]) for n in range(layout.drones)]


def _triangles(radius: float) -> Iterator[Floats]:
    """Yield the corners of one triangle after the other, from the datum to the datum."""
    for pattern in count():
        for heading_deg in TRIANGLE_HEADINGS_DEG:
            first_deg = heading_deg + PATTERN_TURN_DEG * (pattern % 2)
            legs = triangle_legs(first_deg, radius * (1 + pattern // 2))
            yield to_south(np.array(turning_points((0.0, 0.0), legs)))


def spiral_tracks(layout: Layout) -> list[Floats]:
    """Return the arms of an Archimedean spiral, as polylines of short legs."""
    drones, spacing = layout.drones, layout.spacing_m
    rate = drones * spacing / (2 * math.pi)
    # Half a spacing from the datum no arm is in the way of another one.
    first = spacing / 2 / rate if drones > 1 else 0.0
    last = first + math.sqrt(2 * layout.length_m / rate)
    turns = np.linspace(math.sqrt(first), math.sqrt(last), max(int(8 * last), 64)) ** 2
    bearings = turns + 2 * math.pi * np.arange(drones)[:, None] / drones
    arms = rate * turns[:, None] * np.stack([np.sin(bearings), -np.cos(bearings)], axis=-1)
    return list(arms)


LAYOUTS: Mapping[str, Callable[[Layout], list[Floats]]] = MappingProxyType(
    {
        "sweep": sweep_tracks,
        "creeping_line": partial(sweep_tracks, creeping=True),
        "expanding_square": square_tracks,
        "sector": sector_tracks,
        "spiral": spiral_tracks,
    }
)
"""The patterns by the name of their planner."""


def inside(points: Floats, datum: Datum, layout: Layout, speed: float) -> Floats:
    """Return a track without what is off the grid when a drone of this speed arrives there."""
    pieces = [
        np.linspace(a, b, max(math.ceil(math.hypot(*(b - a)) / (layout.spacing_m / 2)), 1) + 1)[1:]
        for a, b in zip(points, points[1:], strict=False)
    ]
    dense = np.concatenate([points[:1], *pieces])
    there = datum.at(along(dense) / speed) + dense
    return dense[((there >= 0.0) & (there <= layout.extent)).all(axis=1)]


def assigned(starts: Floats, tracks: list[Floats]) -> list[Floats]:
    """Return the track of each drone, the nearest pairs of starts and first points first.

    Args:
        starts: (N, 2) float64, relative to the datum.
        tracks: As many tracks.
    """
    away = np.array([[math.hypot(*(track[0] - start)) for track in tracks] for start in starts])
    chosen = [0] * len(starts)
    for _ in starts:
        drone, track = np.unravel_index(int(np.argmin(away)), away.shape)
        chosen[drone] = int(track)
        away[drone], away[:, track] = math.inf, math.inf
    return [tracks[k] for k in chosen]


def tracks_of(
    name: str, datum: Datum, layout: Layout, starts: Floats, speeds: Floats
) -> list[Floats]:
    """Return the track of each drone, from its start along its part of a pattern and back.

    Args:
        name: A key of `LAYOUTS`.
        datum: The datum.
        layout: What the pattern is laid out for.
        starts: (N, 2) float64, positions of the drones on the grid.
        speeds: (N,) float64, their speeds.

    Returns:
        Points relative to the datum, (K, 2) each.
    """
    return _flown(LAYOUTS[name](layout), datum, layout, starts, speeds)


def tracks_along(
    pattern: SearchPattern, datum: Datum, layout: Layout, starts: Floats, speeds: Floats
) -> list[Floats]:
    """Return the track of each drone along a stretch of a given pattern, all as long, and back.

    Args:
        pattern: The pattern.
        datum: As in `tracks_of`, and so are the other arguments.
        layout: The same.
        starts: The same.
        speeds: The same.
    """
    points = to_south(pattern.track.points_m)
    lengths = along(points)
    ends = np.linspace(0.0, lengths[-1], layout.drones + 1)
    stretches = []
    for first, last in zip(ends, ends[1:], strict=False):
        inner = lengths[(lengths > first) & (lengths < last)]
        stretches.append(points_at(points, np.array([first, *inner, last])))
    return _flown(stretches, datum, layout, starts, speeds)


def _flown(
    tracks: list[Floats], datum: Datum, layout: Layout, starts: Floats, speeds: Floats
) -> list[Floats]:
    """Return tracks from the starts of the drones, on the grid, and back and forth."""
    relative, flown = starts - datum.position, []
    for start, track, speed in zip(relative, assigned(relative, tracks), speeds, strict=True):
        kept = inside(track, datum, layout, float(speed))
        longer = np.concatenate([start[None], kept])
        while len(kept) > 1 and along(longer)[-1] < layout.length_m:
            longer = np.concatenate([longer, kept[-2::-1], kept[1:]])
        flown.append(longer)
    return flown


class TrackGuidance(DrawsNothing):
    """Flies each drone along its own track, see `polylines`.

    Args:
        tracks: (K, 2) float64 each, relative to the datum, see `metres_patterns.tracks_of`.
        datum: The datum.
        airframes: (N,) of `AIRFRAMES`, of each drone.
        wind: The wind, and the time of a step.
        extent: Of the grid.
        tolerance_m: Greatest distance from a track.
    """

    def __init__(
        self,
        tracks: Sequence[Floats],
        datum: Datum,
        airframes: NDArray[np.void],
        wind: Wind,
        extent: GridExtent,
        tolerance_m: float,
    ) -> None:
        self._tracks, self._datum, self._airframes = tracks, datum, airframes
        self._wind, self._extent, self._tolerance = wind, extent, tolerance_m
        self._flown = np.zeros(len(tracks))
        self._goals = np.zeros(len(tracks))
        self._path = np.empty((pieces_of(airframes, wind.step_s) + 1, 2))

    def __call__(
        self,
        flights: NDArray[np.void],
        step: int,
        drones: NDArray[np.int64] | None = None,
        *,
        wind: Wind | None = None,
    ) -> Floats:
        """Return the turn and the airspeed of each drone, (D, 2) float64, in radians and m/s.

        Args:
            flights: (D,) of `MOTION_STATES`.
            step: Number of steps done.
            drones: (D,) int64, their numbers; None for all.
            wind: The wind from now on, and the time of a step; None for the last one.
        """
        self._wind = self._wind if wind is None else wind
        numbers = np.arange(len(self._tracks)) if drones is None else drones
        now_s = step * self._wind.step_s
        positions = np.stack([flights["east"], flights["south"]], axis=1)
        relative = positions - self._datum.at(now_s)
        flown, goals = self._flown.copy(), self._goals.copy()
        points = np.empty((len(flights), 2))
        wind, step_s = self._wind, self._wind.step_s
        carried = (np.array([wind.east, wind.south]) - self._datum.drift) * step_s
        for k, n in enumerate(numbers.tolist()):
            track, airframe = self._tracks[n], self._airframes[n]
            passed = np.linspace(goals[n], flown[n], SAMPLES + 1)
            flown[n] = nearest(track, relative[k], passed)
            goals[n], points[k] = goal_within_reach(
                track, relative[k], flown[n], float(airframe["cruise"]) * step_s, carried,
                math.inf if airframe["slowest"] > 0.0 else self._tolerance,
            )  # fmt: skip
        self._flown, self._goals = flown, goals
        goal = points + self._datum.at(now_s + self._wind.step_s)
        return steer(
            self._airframes[numbers], self._wind, self._extent, flights, goal, True, self._path
        )

    def ahead(self, step: int, steps: int) -> list[Floats]:
        """Return where each drone will be, in turn: what is left of its track, at cruise.

        Args:
            step: Number of steps done.
            steps: Steps left.

        Returns:
            (M, 2) float64 each, metres to the east and to the south of the grid's north-west
            corner: where the step ends, and the corners of the track until the steps are over,
            with the datum where it will have drifted by then.
        """
        found = []
        for track, done, airframe in zip(self._tracks, self._goals, self._airframes, strict=True):
            lengths, cruise = along(track), float(airframe["cruise"])
            end = min(done + cruise * (steps - 1) * self._wind.step_s, lengths[-1])
            to_come = np.array([done, *lengths[(lengths > done) & (lengths < end)], end])
            times_s = (step + 1) * self._wind.step_s + (to_come - done) / cruise
            found.append(points_at(track, to_come) + self._datum.at(times_s))
        return found

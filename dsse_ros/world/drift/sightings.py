# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where and when an object was seen, or may have come to grief, as people know it.

Each of these laws gives a particle a `Sighting` of its own: a point, around which it is normally
distributed, and a time. Longitudes of all that belong together are within half a turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pymap3d.lox import loxodrome_direct, loxodrome_inverse
from pymap3d.vincenty import vreckon

from dsse_ros.world.drift.kernels import degrees_per_metre

Line: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Latitudes and longitudes of a line, (N,) each."""
Rings: TypeAlias = tuple[tuple[tuple[float, float], ...], ...]
"""Rings of points (latitude, longitude) without a repeated last one: outer one, then holes."""
_SLAB_DEG = 0.02
"""Height of a piece of an area, in which a degree of longitude has one length."""
_ARC = np.linspace(-1.0, 1.0, 33)


class Sighting(NamedTuple):
    """A place where an object was.

    Attributes:
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        time_s: Time, in seconds since 1970-01-01 UTC.
        radius_m: Distance from there that the object exceeds in one of a hundred cases; its
            position is normal along both axes.
        weight: Weight among several sightings of one object.
        time_error_s: The object was there up to this time before or after.
    """

    lat_deg: float
    lon_deg: float
    time_s: float
    radius_m: float = 0.0
    weight: float = 1.0
    time_error_s: float = 0.0

    @property
    def first_s(self) -> float:
        """Earliest time."""
        return self.time_s - self.time_error_s

    @property
    def last_s(self) -> float:
        """Latest time."""
        return self.time_s + self.time_error_s

    @property
    def label(self) -> str:
        """What it is, for a chart."""
        return "LKP"

    @property
    def place(self) -> tuple[float, float]:
        """Latitude and longitude by which it is known."""
        return self.lat_deg, self.lon_deg

    @property
    def lines(self) -> tuple[Line, ...]:
        """The lines that enclose it, or on which it lies, without its `radius_m`."""
        return ((np.array([self.lat_deg]), np.array([self.lon_deg])),)

    def turned(self, lon_deg: float) -> Sighting:
        """Return the same with longitudes within half a turn of this one."""
        return self._replace(lon_deg=turned(self.lon_deg, lon_deg))

    def draw(self, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return a `Sighting` for each of `count` particles, (count, 6) float64."""
        return np.tile(np.array(self, np.float64), (count, 1))


@dataclass(frozen=True)
class _Spread:
    """What all but a point have.

    Attributes:
        time_s: Time at which it was there, in seconds since 1970-01-01 UTC.
        weight: As that of a `Sighting`.
        time_error_s: Likewise.
    """

    time_s: float
    weight: float = 1.0
    time_error_s: float = 0.0

    @property
    def label(self) -> str:
        """See `Sighting.label`."""
        return "area"

    @property
    def radius_m(self) -> float:
        """As that of a `Sighting`, around each place."""
        return 0.0

    @property
    def first_s(self) -> float:
        """See `Sighting.first_s`."""
        return self.time_s - self.time_error_s

    @property
    def last_s(self) -> float:
        """See `Sighting.last_s`."""
        return self.time_s + self.time_error_s

    def _rows(
        self, lat: NDArray[np.float64], lon: NDArray[np.float64],
        time_s: NDArray[np.float64] | float, radius_m: NDArray[np.float64] | float = 0.0,
    ) -> NDArray[np.float64]:  # fmt: skip
        parts = lat, lon, time_s, radius_m, self.weight, self.time_error_s
        return np.stack(np.broadcast_arrays(*parts), axis=1)


@dataclass(frozen=True)
class SeenArea(_Spread):
    """Somewhere in an area, uniformly.

    Attributes:
        polygons: The area; polygons do not overlap, and their edges are straight in latitude and
            longitude.
    """

    polygons: tuple[Rings, ...] = ()

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        # An outline may have many points.
        return hash((self.time_s, self.weight, self.time_error_s, self.polygons))

    @property
    def place(self) -> tuple[float, float]:
        """See `Sighting.place`: the middle of its outermost points."""
        return _middle(self.lines)

    @cached_property
    def lines(self) -> tuple[Line, ...]:
        """See `Sighting.lines`."""
        rings = [np.array((*ring, ring[0])) for polygon in self.polygons for ring in polygon]
        return tuple((ring[:, 0], ring[:, 1]) for ring in rings)

    @property
    def area_m2(self) -> float:
        """Its area."""
        return float(self._pieces[:, -1].sum())

    def turned(self, lon_deg: float) -> SeenArea:
        """See `Sighting.turned`."""
        polygons = []
        for polygon in self.polygons:
            lons = np.array(polygon[0])[:, 1]
            middle = float(lons.min() + lons.max()) / 2
            turn = turned(middle, lon_deg) - middle
            polygons.append(
                tuple(tuple((lat, lon + turn) for lat, lon in ring) for ring in polygon)
            )
        return replace(self, polygons=tuple(polygons))

    @cached_property
    def _pieces(self) -> NDArray[np.float64]:
        """The area as trapezoids, (K, 7) float64.

        Columns: south and north; the longitudes of the western side in the south and in the north;
        the widths there, in degrees; the area in m2.
        """
        ends = [(lats[:-1], lons[:-1], lats[1:], lons[1:]) for lats, lons in self.lines]
        edges = np.concatenate([np.stack(of_ring, axis=1) for of_ring in ends])
        falls = edges[:, 0] > edges[:, 2]
        edges[falls] = edges[falls][:, [2, 3, 0, 1]]
        edges = edges[edges[:, 0] < edges[:, 2]]
        between = np.arange(edges[:, 0].min(), edges[:, 2].max(), _SLAB_DEG)
        cuts = np.unique(np.concatenate([edges[:, 0], edges[:, 2], between]))
        slabs = []
        for south, north in zip(cuts[:-1], cuts[1:], strict=True):
            across = edges[(edges[:, 0] <= south) & (edges[:, 2] >= north)]
            slope = (across[:, 3] - across[:, 1]) / (across[:, 2] - across[:, 0])
            low, high = (across[:, 1] + slope * (lat - across[:, 0]) for lat in (south, north))
            order = np.argsort(low + high)
            # Inside is between the first and the second edge from the west, and so on.
            west, east = order[::2], order[1::2]
            wide = np.stack([low[east] - low[west], high[east] - high[west]], axis=1)
            lat_per_m, lon_per_m = degrees_per_metre((south + north) / 2)
            area_m2 = wide.sum(axis=1) / 2 * (north - south) / (lat_per_m * lon_per_m)
            bounds = np.broadcast_to([south, north], (len(west), 2))
            slabs.append(np.column_stack([bounds, low[west], high[west], wide, area_m2]))
        return np.concatenate(slabs)

    def draw(self, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """See `Sighting.draw`."""
        chosen = _chosen(self._pieces[:, -1], count, rng)
        south, north, low, high, wide, wide_north, _ = self._pieces[chosen].T
        up, across = rng.random((2, count))
        # The height within a trapezoid is distributed as its width.
        square = wide**2 + (wide_north**2 - wide**2) * up
        share = up * (wide + wide_north) / (wide + np.sqrt(square))
        lon = low + share * (high - low) + across * (wide + share * (wide_north - wide))
        return self._rows(south + share * (north - south), lon, self.time_s)


@dataclass(frozen=True)
class SeenRaster(_Spread):
    """Somewhere in a raster, by the probabilities of its cells, uniformly within each.

    Attributes:
        south_deg: Latitude of the southern edge.
        north_deg: That of the northern one.
        west_deg: Longitude of the western edge.
        east_deg: That of the eastern one.
        weights: (R, C) float64, row 0 in the north; their sum is above 0.
        sha256: Digest of the weights; those with the same one are equal.
    """

    south_deg: float = 0.0
    north_deg: float = 0.0
    west_deg: float = 0.0
    east_deg: float = 0.0
    weights: NDArray[np.float64] = field(default_factory=lambda: np.ones((1, 1)), compare=False)
    sha256: str = ""

    @property
    def place(self) -> tuple[float, float]:
        """See `Sighting.place`: its middle."""
        return _middle(self.lines)

    @property
    def lines(self) -> tuple[Line, ...]:
        """See `Sighting.lines`: those around the cells with a weight above 0."""
        rows, cols = (np.flatnonzero(self.weights.any(axis=axis)) for axis in (1, 0))
        north, south = self._lats(np.array([rows[0], rows[-1] + 1.0]))
        west, east = self._lons(np.array([cols[0], cols[-1] + 1.0]))
        ring = (
            np.array([south, south, north, north, south]),
            np.array([west, east, east, west, west]),
        )
        return (ring,)

    def turned(self, lon_deg: float) -> SeenRaster:
        """See `Sighting.turned`."""
        turn = turned(self.place[1], lon_deg) - self.place[1]
        return replace(self, west_deg=self.west_deg + turn, east_deg=self.east_deg + turn)

    def _lats(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.north_deg - rows * (self.north_deg - self.south_deg) / self.weights.shape[0]

    def _lons(self, cols: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.west_deg + cols * (self.east_deg - self.west_deg) / self.weights.shape[1]

    def draw(self, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """See `Sighting.draw`."""
        rows, cols = np.divmod(_chosen(self.weights.ravel(), count, rng), self.weights.shape[1])
        down, across = rng.random((2, count))
        return self._rows(self._lats(rows + down), self._lons(cols + across), self.time_s)


class WayPoint(NamedTuple):
    """A place on a voyage.

    Attributes:
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        time_s: Time at which the vessel was to be there, in seconds since 1970-01-01 UTC.
        radius_m: As that of a `Sighting`; it changes evenly along a leg.
    """

    lat_deg: float
    lon_deg: float
    time_s: float
    radius_m: float = 0.0


@dataclass(frozen=True)
class Voyage(_Spread):
    """Somewhere on a voyage whose legs are rhumb lines, each sailed at an even speed.

    `time_s` is the departure. The accident is as likely in each minute of a leg, and the object
    drifts from then on.

    Attributes:
        way_points: Two or more, in the order of their increasing times.
        leg_weights: Weight of each leg, at least one above 0.
    """

    way_points: tuple[WayPoint, ...] = ()
    leg_weights: tuple[float, ...] = ()

    @property
    def label(self) -> str:
        """See `Sighting.label`."""
        return "voyage"

    @property
    def radius_m(self) -> float:
        """The greatest one of a way point."""
        return max(point.radius_m for point in self.way_points)

    @property
    def last_s(self) -> float:
        """See `Sighting.last_s`: the arrival."""
        return self.way_points[-1].time_s + self.time_error_s

    @property
    def place(self) -> tuple[float, float]:
        """See `Sighting.place`: the departure."""
        return self.way_points[0][:2]

    @property
    def lines(self) -> tuple[Line, ...]:
        """See `Sighting.lines`."""
        lats, lons, *_ = np.array(self.way_points).T
        return ((lats, lons),)

    def turned(self, lon_deg: float) -> Voyage:
        """See `Sighting.turned`."""
        points = tuple(
            point._replace(lon_deg=turned(point.lon_deg, lon_deg)) for point in self.way_points
        )
        return replace(self, way_points=points)

    def draw(self, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """See `Sighting.draw`."""
        points = np.array(self.way_points, np.float64)
        leg = _chosen(np.array(self.leg_weights), count, rng)
        share = rng.random(count)
        length_m, course_deg = rhumb_lines(points[:-1], points[1:])
        start, end = points[:-1][leg].T, points[1:][leg].T
        lat, lon = loxodrome_direct(start[0], start[1], share * length_m[leg], course_deg[leg])
        time_s, radius_m = (
            (1 - share) * a + share * b for a, b in zip(start[2:], end[2:], strict=True)
        )
        return self._rows(np.reshape(lat, count), np.reshape(lon, count), time_s, radius_m)


@dataclass(frozen=True)
class Bearing(_Spread):
    """Somewhere on a bearing from a place, uniformly in a sector around it.

    Attributes:
        lat_deg: WGS84 latitude of the place from where it was taken.
        lon_deg: Its longitude.
        bearing_deg: The bearing, clockwise from true north.
        bearing_error_deg: The object was up to this much to the left or to the right of it.
        least_m: Least range.
        greatest_m: Greatest range, above the least.
    """

    lat_deg: float = 0.0
    lon_deg: float = 0.0
    bearing_deg: float = 0.0
    bearing_error_deg: float = 0.0
    least_m: float = 0.0
    greatest_m: float = 0.0

    @property
    def label(self) -> str:
        """See `Sighting.label`."""
        return f"bearing {round(self.bearing_deg) % 360:03d}°"

    @property
    def place(self) -> tuple[float, float]:
        """See `Sighting.place`: from where it was taken."""
        return self.lat_deg, self.lon_deg

    @cached_property
    def lines(self) -> tuple[Line, ...]:
        """See `Sighting.lines`."""
        azimuth = self.bearing_deg + self.bearing_error_deg * np.concatenate(
            [_ARC, -_ARC, _ARC[:1]]
        )
        near, far = np.full(len(_ARC), self.least_m), np.full(len(_ARC), self.greatest_m)
        return (self._at(azimuth, np.concatenate([near, far, near[:1]])),)

    def turned(self, lon_deg: float) -> Bearing:
        """See `Sighting.turned`."""
        return replace(self, lon_deg=turned(self.lon_deg, lon_deg))

    def _at(self, azimuth_deg: NDArray[np.float64], range_m: NDArray[np.float64]) -> Line:
        lat, lon = vreckon(self.lat_deg, self.lon_deg, range_m, azimuth_deg)
        east_deg = (np.reshape(lon, range_m.shape) - self.lon_deg + 180) % 360 - 180
        return np.reshape(lat, range_m.shape), self.lon_deg + east_deg

    def draw(self, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """See `Sighting.draw`."""
        azimuth_deg = self.bearing_deg + self.bearing_error_deg * rng.uniform(-1.0, 1.0, count)
        # Uniform in the area: the square of the range is uniform.
        range_m = np.sqrt(rng.uniform(self.least_m**2, self.greatest_m**2, count))
        return self._rows(*self._at(azimuth_deg, range_m), self.time_s)


Seen: TypeAlias = Sighting | SeenArea | SeenRaster | Voyage | Bearing


def draw_sightings(
    seen: Sequence[Seen], chosen: NDArray[np.int64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return a `Sighting` for each particle, (M, 6) float64, by that of `seen` it has.

    Args:
        seen: Where and when the object was seen.
        chosen: (M,) which of these each particle has.
        rng: Generator of the draws.
    """
    drawn = np.empty((len(chosen), len(Sighting._fields)))
    for number, one in enumerate(seen):
        own = np.flatnonzero(chosen == number)
        if len(own):
            drawn[own] = one.draw(len(own), rng)
    return drawn


def rhumb_lines(
    start: NDArray[np.float64], end: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return lengths in metres and courses in degrees of the rhumb lines between places.

    Args:
        start: (N, 2) or more columns, latitude and longitude first.
        end: Likewise.
    """
    length_m, course_deg = loxodrome_inverse(start[:, 0], start[:, 1], end[:, 0], end[:, 1])
    return np.reshape(length_m, len(start)), np.reshape(course_deg, len(start))


def turned(lon_deg: float, near_deg: float) -> float:
    """Return a longitude within half a turn of another one."""
    return lon_deg + 360 * round((near_deg - lon_deg) / 360)


def _chosen(
    weights: NDArray[np.float64], count: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Return indices drawn by these weights, (count,)."""
    ends = np.cumsum(weights)
    drawn = np.searchsorted(ends, ends[-1] * rng.random(count), side="right")
    # Rounding may reach the end.
    return np.minimum(drawn, np.flatnonzero(weights)[-1])


def _middle(lines: Sequence[Line]) -> tuple[float, float]:
    lats, lons = (np.concatenate(axis) for axis in zip(*lines, strict=True))
    return float(lats.min() + lats.max()) / 2, float(lons.min() + lons.max()) / 2

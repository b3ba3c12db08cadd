# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Search patterns of the IAMSAR manual, vol. II and III, as turning points in metres.

The expanding square and the sector search of the planners fly the same legs over the grid.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError, check_all, field

MAX_LANES = 1000

TRIANGLE_TURN_DEG = 120
TRIANGLE_HEADINGS_DEG = (0, 240, 120)
"""Headings of the first legs of the triangles of a sector search, from that of the first one."""


class Leg(NamedTuple):
    """A straight leg.

    Attributes:
        heading_deg: Clockwise from north.
        length: In the unit of the caller.
    """

    heading_deg: float
    length: float


def square_legs(lanes: int) -> Iterator[Leg]:
    """Yield the legs of an expanding square over a square of so many lanes, in track spacings.

    Their lengths are 1, 1, 2, 2, 3, 3, ...; the last one is as long as the two before it.
    """
    for leg in range(2 * lanes - 1):
        yield Leg(leg % 4 * 90, min(leg // 2 + 1, lanes - 1))


def triangle_legs(first_heading_deg: float, radius: float) -> list[Leg]:
    """Return the legs of one of the triangles of a sector search, from the datum to the datum."""
    return [Leg(first_heading_deg + turns * TRIANGLE_TURN_DEG, radius) for turns in range(3)]


def lane_legs(lanes: int, lane_length: float, spacing: float) -> Iterator[Leg]:
    """Yield the legs of parallel lanes and the cross legs of one spacing between them."""
    for lane in range(lanes):
        if lane:
            yield Leg(90, spacing)
        yield Leg(lane % 2 * 180, lane_length)


def turning_points(start: tuple[float, float], legs: Iterable[Leg]) -> list[tuple[float, float]]:
    """Return the start and the end of each leg, as (to the east, to the north)."""
    points = [start]
    for heading_deg, length in legs:
        east, north = points[-1]
        heading = math.radians(heading_deg)
        points.append((east + length * math.sin(heading), north + length * math.cos(heading)))
    return points


class PatternTrack(NamedTuple):
    """The track of a search pattern.

    Attributes:
        points_m: (K, 2) turning points, metres to the east and north of the datum; the first one
            is the commence search point.
        area_m2: Area that the pattern covers.
    """

    points_m: NDArray[np.float64]
    area_m2: float

    @property
    def length_m(self) -> float:
        """Length of the track."""
        return float(np.hypot(*np.diff(self.points_m, axis=0).T).sum())


@dataclass(frozen=True, kw_only=True)
class SearchPattern:
    """A search pattern for one vehicle, by the values that a search coordinator gives.

    PS, CS and SS cover whole lanes of one track spacing: if the spacing does not divide the area,
    the area grows. Their tracks stay half a track spacing inside it.

    Raises:
        FieldError: If a value is not allowed, or one that the pattern needs is missing.
    """

    pattern: str = field(
        "str", "Parallel track (PS), creeping line (CS), sector (VS) or expanding square (SS) "
        "search.", choices=("PS", "CS", "VS", "SS"),
    )  # fmt: skip
    heading: float = field(
        "float", "Heading of the first leg, clockwise from north.", 0.0, low=-360, high=360,
        unit="deg",
    )  # fmt: skip
    track_spacing: float | None = field(
        "float", "PS, CS, SS: distance between adjacent tracks.", None, above=0, high=1e6, unit="m"
    )
    length: float = field(
        "float", "PS, CS: long side of the area; SS: side of the area; VS: length of the legs, the "
        "radius of the area.", above=0, high=1e6, unit="m",
    )  # fmt: skip
    width: float | None = field(
        "float", "PS, CS: short side of the area. Legs are along the long side in PS, along the "
        "short side in CS.", None, above=0, high=1e6, unit="m",
    )  # fmt: skip
    first_turn: str = field(
        "str", "Side of the first turn.", "starboard", choices=("starboard", "port")
    )

    def __post_init__(self) -> None:
        check_all(self)
        case = f"with pattern {self.pattern}"
        needed = {"track_spacing": self.pattern != "VS", "width": self.pattern in ("PS", "CS")}
        for name, is_needed in needed.items():
            value = getattr(self, name)
            if (value is not None) != is_needed:
                allowed = "a finite number > 0 m" if is_needed else "None"
                raise FieldError(f"{name} must be {allowed} {case}, got {value}")
        if self.width is not None and self.width > self.length:
            raise FieldError(f"width must be <= length, {self.length:g} m, got {self.width:g}")
        if self.track_spacing is not None:
            along, across = self._sides
            least = across / MAX_LANES
            if not least <= self.track_spacing < along:
                raise FieldError(
                    f"track_spacing must be >= {least:g} m, for at most {MAX_LANES} lanes, and "
                    f"less than the {along:g} m along them, got {self.track_spacing:g}"
                )

    @property
    def _sides(self) -> tuple[float, float]:
        """Sides of the area along and across the lanes."""
        length, width = self.length, self.length if self.width is None else self.width
        return (width, length) if self.pattern == "CS" else (length, width)

    @property
    def track(self) -> PatternTrack:
        """The track, relative to the datum: the centre of the area, for SS and VS the first point.

        With an even number of lanes, the datum of SS is half a track spacing off the centre.
        """
        if self.track_spacing is None:
            radius = self.length
            legs = [leg for first in TRIANGLE_HEADINGS_DEG for leg in triangle_legs(first, radius)]
            return self._turned((0.0, 0.0), legs, math.pi * radius**2)
        spacing, (along, across) = self.track_spacing, self._sides
        # A quotient may be a rounding error above a whole number.
        lanes = math.ceil(across / spacing - 1e-9)
        if self.pattern == "SS":
            legs = [Leg(leg.heading_deg, leg.length * spacing) for leg in square_legs(lanes)]
            return self._turned((0.0, 0.0), legs, (lanes * spacing) ** 2)
        lane_length = along - spacing
        start = -(lanes - 1) * spacing / 2, -lane_length / 2
        return self._turned(start, lane_legs(lanes, lane_length, spacing), lanes * spacing * along)

    def _turned(
        self, start: tuple[float, float], legs: Iterable[Leg], area_m2: float
    ) -> PatternTrack:
        """Return the track of legs that turn to starboard from a first one to the north."""
        points = np.array(turning_points(start, legs))
        if self.first_turn == "port":
            points[:, 0] *= -1
        heading = math.radians(self.heading)
        sin, cos = math.sin(heading), math.cos(heading)
        return PatternTrack(points @ np.array([[cos, -sin], [sin, cos]]), area_m2)

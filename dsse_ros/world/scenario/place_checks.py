# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The checks of a place on the Earth that somebody states: its degrees, and that it is near.

A latitude and a longitude that are exchanged are a place on the Earth too, mostly thousands of
kilometres away.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from dsse_ros.base.fields import FieldError, Spec, shown
from dsse_ros.world.scenario.positions import (
    EXAMPLES,
    LAT_LETTERS,
    LON_LETTERS,
    degrees,
    position,
)


@dataclass(frozen=True)
class Angle(Spec):
    """A latitude or a longitude: a number of degrees, or text as `positions` reads it.

    Attributes:
        letters: See `positions.degrees`.
    """

    letters: str = LAT_LETTERS

    def allowed(self) -> str:
        """Return the allowed values as text."""
        example = "38 40.5 N" if self.letters == LAT_LETTERS else "009 25.1 W"
        return f"{super().allowed()}, or text such as {example}"

    def check(self, name: str, value: Any) -> Any:
        """See `Spec.check`."""
        stated = value
        if isinstance(value, str):
            with contextlib.suppress(ValueError):
                stated = degrees(value, self.letters)
        try:
            return super().check(name, stated)
        except FieldError:
            raise FieldError(f"{name} must be {self.allowed()}, got {shown(value)}") from None


LAT = Angle("float", "", low=-85, high=85, unit="deg", letters=LAT_LETTERS)
LON = Angle("float", "", low=-360, high=360, unit="deg", letters=LON_LETTERS)
FARTHEST_M = 500_000.0
"""Greatest distance of a place from the search: no drone and no drift of a day comes farther."""
_EARTH_RADIUS_M = 6_371_000.0


def place_of(name: str, value: Any) -> tuple[float, float]:
    """Return latitude and longitude of a place.

    Args:
        name: Name of the place, for the error.
        value: Text as `positions.position` reads it, or latitude and longitude.

    Raises:
        FieldError: If it is neither, or not on the Earth.
    """
    try:
        if isinstance(value, str):
            value = position(value)
        if not isinstance(value, Sequence):
            raise TypeError
        lat, lon = value
    except (TypeError, ValueError):
        raise FieldError(
            f"{name} must be [lat, lon], or text such as {EXAMPLES}, got {shown(value)}"
        ) from None
    return LAT.check(name, lat), LON.check(name, lon)


def check_near(
    name: str,
    place: tuple[float, float],
    search: tuple[float, float],
    *,
    within_m: float = 0.0,
    order: str = "latitude, longitude",
) -> None:
    """Check that a place is at most `FARTHEST_M` from a search.

    Args:
        name: Name of the place, for the error.
        place: Its latitude and longitude in degrees.
        search: Those of the middle of the search.
        within_m: Radius of the search, which counts in addition.
        order: Order of the two numbers where the place is stated, for the error.

    Raises:
        FieldError: If it is farther.
    """
    shown = f"{place[0]:.6g}, {place[1]:.6g} (the order is {order})"
    away_m = distance_m(place, search) - within_m
    check_distance(name, away_m, f"the search at {search[0]:.6g}, {search[1]:.6g}", shown)


def check_distance(name: str, away_m: float, search: str, shown: str) -> None:
    """Check a distance from a search, see `check_near`.

    Args:
        name: Name of the place, for the error.
        away_m: The distance.
        search: Where the search is, for the error.
        shown: The place, for the error.

    Raises:
        FieldError: If it is more than `FARTHEST_M`.
    """
    if away_m > FARTHEST_M:
        raise FieldError(
            f"{name} must be at most {FARTHEST_M / 1000:.0f} km from {search}, got {shown}, "
            f"{away_m / 1000:.0f} km away"
        )


def distance_m(start: tuple[float, float], end: tuple[float, float]) -> float:
    """Return the distance between places in degrees; the Earth is a sphere here."""
    lat, other_lat = math.radians(start[0]), math.radians(end[0])
    half_lat, half_lon = (other_lat - lat) / 2, math.radians(end[1] - start[1]) / 2
    share = math.sin(half_lat) ** 2 + math.cos(lat) * math.cos(other_lat) * math.sin(half_lon) ** 2
    return 2 * _EARTH_RADIUS_M * math.asin(min(1.0, math.sqrt(share)))

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Metres north and east of home, in which the vehicle flies, and degrees, which it reports."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

_SEMI_MAJOR_M = 6378137.0
_ECCENTRICITY_2 = 6.69437999014e-3
_REACH_M = 1e6


class Point(NamedTuple):
    """Metres from home."""

    north_m: float
    east_m: float
    up_m: float

    @property
    def within_reach(self) -> bool:
        """Whether it is a place at all, and one that could be flown to."""
        return max(abs(self.north_m), abs(self.east_m), abs(self.up_m)) < _REACH_M


@dataclass(frozen=True)
class Place:
    """A place on the Earth.

    Attributes:
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_amsl_m: Height above mean sea level.
    """

    lat_deg: float
    lon_deg: float
    alt_amsl_m: float


class LocalFrame:
    """A plane with the ellipsoid's radii at home.

    There and back is exact, so a vehicle comes to rest on its target at any distance. Only its
    way is longer or shorter than the plane says, by less than 0.1 % within 10 km of home.
    """

    def __init__(self, home: Place) -> None:
        self.home = home
        lat = math.radians(home.lat_deg)
        squeeze = 1.0 - _ECCENTRICITY_2 * math.sin(lat) ** 2
        meridian_m = _SEMI_MAJOR_M * (1.0 - _ECCENTRICITY_2) / squeeze**1.5
        normal_m = _SEMI_MAJOR_M / math.sqrt(squeeze)
        self._m_per_deg_north = math.radians(meridian_m)
        self._m_per_deg_east = math.radians(normal_m * math.cos(lat))

    def horizontal(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """Return metres north and east of home, the short way round the Earth."""
        lon = (lon_deg - self.home.lon_deg + 180.0) % 360.0 - 180.0
        return (lat_deg - self.home.lat_deg) * self._m_per_deg_north, lon * self._m_per_deg_east

    def geodetic(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Return latitude and longitude in degrees."""
        lat_deg = self.home.lat_deg + north_m / self._m_per_deg_north
        lon_deg = self.home.lon_deg + east_m / self._m_per_deg_east
        return lat_deg, (lon_deg + 180.0) % 360.0 - 180.0

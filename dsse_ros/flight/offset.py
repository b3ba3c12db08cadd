# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Metres between places that are near each other."""

from __future__ import annotations

import math

_METRES_PER_DEGREE = 111_195.0


def offset_m(start: tuple[float, float], end: tuple[float, float]) -> tuple[float, float]:
    """Return metres to north and east between places in degrees, exact enough along a leg."""
    north_m = (end[0] - start[0]) * _METRES_PER_DEGREE
    east_deg = (end[1] - start[1] + 180) % 360 - 180
    return north_m, east_deg * _METRES_PER_DEGREE * math.cos(math.radians(start[0]))

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A camera that looks straight down: the POD of an object in its footprint.

The POD is a logistic function of the logarithm of the pixels across the object, as in Johnson's
criteria for detection ("Analysis of Image Forming Systems", 1958): 0.5 at 2 pixels (a line pair)
and 0.79 at 4. It is at most 0.91, the sensitivity for a person in the sea of Claesson et al.
(Scand. J. Trauma Resusc. Emerg. Med. 28, 2020) from 40 m; 17.5 % of their photos had a false alarm.
For want of a published POD by sea state, the weather has the factors of sweep widths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from dsse_ros.world.sensors.lateral_range import LateralRange, beside, strip
from dsse_ros.world.sensors.sensor import SEARCH, Look, Sensor, looks_with
from dsse_ros.world.sensors.sweep_width import WEATHER_FACTORS

PAPER_FIELD_OF_VIEW_DEG = 2 * math.degrees(math.atan2(65, 120))
"""A camera that sees 130 m x 130 m = 16900 m^2 from 120 m (paper, section "Environment and the real
world")."""
MAX_POD = 0.91
MAX_WIDTH = 7.0
"""Greatest width of the footprint in cells, for which the looks of a search suffice."""
_HALF_PX = 2.0
_EXPONENT = math.log(0.79 / 0.21) / math.log(4.0 / _HALF_PX)


def footprint_m(altitude_m: float, field_of_view_deg: float) -> float:
    """Return the width of the sea in an image."""
    return 2 * altitude_m * math.tan(math.radians(field_of_view_deg) / 2)


def image_pod(pixels: float) -> float:
    """Return the POD of an object in an image, by the pixels across it."""
    return min(1.0 / (1.0 + (_HALF_PX / pixels) ** _EXPONENT), MAX_POD) if pixels > 0 else 0.0


def looks(scenario: Any, searcher: Any, action: str, heading: tuple[int, int]) -> Sequence[Look]:
    """Return looks at the cells in the footprint: a move passes over them once, a search hovers.

    Raises:
        ValueError: If the footprint is too many cells wide.
    """
    if action != SEARCH and heading == (0, 0):
        return ()
    width_m = footprint_m(searcher.altitude, scenario.field_of_view)
    width = width_m / scenario.cell_size
    if width > MAX_WIDTH:
        raise ValueError(
            f"cell_size must be at least {width_m / MAX_WIDTH:g} m for a footprint of "
            f"{width_m:g} m, got {scenario.cell_size:g}"
        )
    in_view_s = width_m / searcher.speed if action != SEARCH else scenario.step_duration_s
    pod = _pod(scenario, width_m, in_view_s)
    seen = beside(heading if any(heading) else (1, 0), width / 2 + 0.75, strip(width))
    if action == SEARCH:
        seen = {(x, y): a * b for (_, x), a in seen.items() for (_, y), b in seen.items()}
    return looks_with({cell: part * pod for cell, part in seen.items()}, scenario)


def lateral(scenario: Any, searcher: Any) -> LateralRange:
    """Return the POD of a strip as wide as the footprint."""
    width_m = footprint_m(searcher.altitude, scenario.field_of_view)
    return LateralRange(width_m / 2, _pod(scenario, width_m, width_m / searcher.speed))


def _pod(scenario: Any, width_m: float, in_view_s: float) -> float:
    """Return the POD of an object that is in the footprint for a time."""
    pod = image_pod(scenario.object_size / width_m * scenario.image_width)
    pod *= WEATHER_FACTORS[scenario.weather]["small"]
    return pod * (min(in_view_s / scenario.dwell_time, 1.0) if scenario.dwell_time > 0 else 1.0)


CAMERA = Sensor("sees the cells in the footprint of its camera", looks, lateral)

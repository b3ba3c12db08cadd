# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Divisions of a search area among units, as numbers that an optimiser may choose freely.

A rectangle is cut in two, each part goes to some of the units and is cut again, until each unit has
a part of its own. So areas never overlap. A unit lays its area out in its part: the legs along one
of the sides, from one of the corners, as far apart as its time allows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.search_plan.assignments import (
    Assignment,
    Choice,
    SearchUnit,
    assignment_of,
)
from dsse_ros.planners.search_plan.rectangles import Rectangle

Floats = NDArray[np.float64]

LAYOUTS = 8
"""Ways to lay out a track in a rectangle: along either side, from any of its corners."""
MOST_LANES = 400
_TRIES = 8


class Cloud(NamedTuple):
    """Where persons are in the middle of a search.

    Attributes:
        mean: (2,) float64, m.
        covariance: (2, 2) float64, m^2.
    """

    mean: Floats
    covariance: Floats


def bounds_of(units: Sequence[SearchUnit], cloud: Cloud) -> Floats:
    """Return the lowest and the largest value of each number of a division, (D, 2)."""
    values, vectors = np.linalg.eigh(cloud.covariance)
    reach = math.sqrt(float(values[1]))
    heading = math.degrees(math.atan2(vectors[0, 1], -vectors[1, 1]))
    swept = math.log(sum(_effort_m2(unit) for unit in units))
    count, cuts = len(units), len(units) - 1
    return np.array(
        [
            *((middle - reach, middle + reach) for middle in cloud.mean.tolist()),
            (heading - 90, heading + 90),
            # The logarithms of the area and of the ratio of its sides.
            (swept - 1.5, swept + 0.7),
            (-1.5, 1.5),
            *[(0.0, 1.0)] * (count + 2 * cuts),
            *[(-1.0, 1.0)] * cuts,
            *[(0.0, float(LAYOUTS))] * count,
        ]
    )


def divided(units: Sequence[SearchUnit], numbers: Floats) -> list[Assignment] | None:
    """Return the assignments of a division.

    Args:
        units: N of them.
        numbers: (D,), see `bounds_of`: centre, heading, area and ratio of the rectangle; the order
            of the units; at each cut how many of them are on one side, along which side of the
            rectangle it is, and how much more or less than their share of the effort they get; the
            layout of each unit.

    Returns:
        None if a unit has no time for its part.
    """
    count, cuts = len(units), len(units) - 1
    east, south, heading_deg, log_area, log_ratio, *rest = numbers.tolist()
    order, counts, sides, shares, layouts = (
        rest[:count], rest[count : count + cuts], rest[count + cuts : count + 2 * cuts],
        rest[count + 2 * cuts : count + 3 * cuts], rest[count + 3 * cuts :],
    )  # fmt: skip
    along, across = (math.exp((log_area + sign * log_ratio) / 2) for sign in (1, -1))
    parts = {}
    waiting = [(Rectangle(east, south, heading_deg, along, across), np.argsort(order).tolist())]
    cut = 0
    while waiting:
        whole, numbered = waiting.pop()
        if len(numbered) == 1:
            parts[numbered[0]] = whole
            continue
        first = min(1 + int(counts[cut] * (len(numbered) - 1)), len(numbered) - 1)
        groups = numbered[:first], numbered[first:]
        left, right = (sum(_effort_m2(units[n]) for n in group) for group in groups)
        left *= math.exp(shares[cut])
        pieces = halves(whole, left / (left + right), sides[cut] < 0.5)
        waiting += zip(pieces, groups, strict=True)
        cut += 1
    assignments = []
    for n, unit in enumerate(units):
        laid = laid_out(unit, parts[n], min(int(layouts[n]), LAYOUTS - 1))
        if laid is None:
            return None
        assignments.append(laid)
    return assignments


def halves(whole: Rectangle, share: float, along: bool) -> tuple[Rectangle, Rectangle]:
    """Return the two parts of a rectangle that is cut, the first with this share of it.

    Args:
        along: Whether its side `along` is divided, not `across`.
    """
    side = "along" if along else "across"
    length, (east, south) = getattr(whole, side), whole.axes[0 if along else 1]

    def part(of: float, shift: float) -> Rectangle:
        return whole._replace(
            east=whole.east + east * shift * length, south=whole.south + south * shift * length,
            **{side: of * length},
        )  # fmt: skip

    return part(share, (share - 1) / 2), part(1 - share, share / 2)


def laid_out(unit: SearchUnit, part: Rectangle, layout: int) -> Assignment | None:
    """Return the assignment with the fewest legs that fits into a rectangle and fills its width.

    Args:
        unit: The unit.
        part: The rectangle.
        layout: 0 to `LAYOUTS` - 1.

    Returns:
        None if there is none.
    """
    along, across, heading = part.along, part.across, part.heading_deg
    if layout >= 4:
        along, across, heading = across, along, heading + 90
    heading = (heading + 180 * (layout % 2)) % 360
    # With n legs of length along - spacing, n - 1 cross legs of one spacing across / n, and 2 n - 2
    # turns, the track is n (along + 2 turns) - across / n - 2 turns long.
    turn = unit.turn_s * unit.speed_mps
    lane = along + 2 * turn
    distance = math.hypot(unit.base[0] - part.east, unit.base[1] - part.south)
    length = max(unit.longest_m - distance, 0.0) + 2 * turn
    root = (length + math.sqrt(length**2 + 4 * lane * across)) / (2 * lane)
    for lanes in range(max(int(root) - 1, 1), min(int(root) + _TRIES, MOST_LANES)):
        choice = Choice(part.east, part.south, heading, layout // 2 % 2 == 1, lanes, across / lanes)
        laid = assignment_of(unit, choice)
        if laid is not None and laid.along_m <= along:
            return laid
    return None


def _effort_m2(unit: SearchUnit) -> float:
    return unit.longest_m * unit.sweep_width_m

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rectangles in metres to the east and to the south, and how far they are apart."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Rectangle(NamedTuple):
    """A rectangle.

    Attributes:
        east: Centre, m.
        south: The same.
        heading_deg: Of the side `along`, clockwise from north.
        along: Length of that side, m.
        across: Length of the other one, m.
    """

    east: float
    south: float
    heading_deg: float
    along: float
    across: float

    @property
    def area_m2(self) -> float:
        """Its area."""
        return self.along * self.across

    @property
    def axes(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Unit vectors of `along` and `across`, (east, south) each."""
        heading = math.radians(self.heading_deg)
        sin, cos = math.sin(heading), math.cos(heading)
        return (sin, -cos), (cos, sin)

    @property
    def corners(self) -> NDArray[np.float64]:
        """(4, 2) corners in turn, (east, south)."""
        along, across = np.array(self.axes) * [[self.along / 2], [self.across / 2]]
        return np.array([self.east, self.south]) + [
            along - across, along + across, across - along, -along - across,
        ]  # fmt: skip

    def contains(self, points: NDArray[np.floating]) -> NDArray[np.bool_]:  # type: ignore[type-arg]
        """Return which points (..., 2) lie in it."""
        points = np.asarray(points, np.float64)
        east, south = points[..., 0] - self.east, points[..., 1] - self.south
        (x, y), (u, v) = self.axes
        inside: NDArray[np.bool_] = np.abs(x * east + y * south) <= self.along / 2
        return inside & (np.abs(u * east + v * south) <= self.across / 2)


def gap_m(a: Rectangle, b: Rectangle) -> float:
    """Return a distance by which two rectangles are apart; if negative, they overlap.

    It is the largest distance between their projections on the direction of a side: two convex
    shapes are apart if and only if they are so on one of these.
    """
    sides = [
        ((axis[0] * length, axis[1] * length))
        for shape in (a, b)
        for axis, length in zip(shape.axes, (shape.along / 2, shape.across / 2), strict=True)
    ]
    east, south = b.east - a.east, b.south - a.south
    return max(
        abs(x * east + y * south) - sum(abs(x * side[0] + y * side[1]) for side in sides)
        for shape in (a, b)
        for x, y in shape.axes
    )

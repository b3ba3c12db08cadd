# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The cells beside a drone's path, and the POD of each as the drone passes it once.

A lateral range curve gives the POD of an object by its distance from the path. The POD of a cell is
the mean over the cell. Each step looks at the cells abeam of the cell that it enters, so that a
straight path looks once at every cell beside it. Lengths are in cells.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class LateralRange(NamedTuple):
    """How a sensor sees what a drone passes, in metres.

    With a sweep width this is the inverse cube law, else definite range.

    Attributes:
        reach_m: Distance within which a pass detects.
        pod: POD of such a pass.
        sweep_width_m: Sweep width of the inverse cube law.
        speed_mps: Speed for which it holds.
    """

    reach_m: float = 0.0
    pod: float = 0.0
    sweep_width_m: float = 0.0
    speed_mps: float = 0.0


Pods = dict[tuple[int, int], float]
"""POD by offset (dx, dy) from the drone after its step."""
Curve = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""curve(ranges) returns (C,) PODs of cells, from (C, Q) distances of points of each to the path."""

REACH = 15.0
"""Greatest distance of a cell from the path, so that no action has more than `MAX_LOOKS`."""
MIN_POD = 1e-4
"""Cells with a lower POD are not looked at."""
POINTS = 64
"""Points along each side of a cell, whose mean is 4 % off for sweep widths of 0.03 cells."""


def beside(heading: tuple[int, int], reach: float, curve: Curve) -> Pods:
    """Return the POD of each cell abeam of a step.

    Args:
        heading: The step (dx, dy), along a row, a column or a diagonal.
        reach: Distance from the path to the centre of the outermost cell, at most `REACH`.
        curve: The lateral range curve.
    """
    east, south = heading
    squared = east * east + south * south
    span = np.arange(-math.ceil(reach), math.ceil(reach) + 1)
    dx, dy = (axis.ravel() for axis in np.meshgrid(span, span))
    # Integers, as a cell on the edge between two steps belongs to one of them.
    along, across = 2 * (dx * east + dy * south), (dy * east - dx * south) / math.sqrt(squared)
    near = (along >= -squared) & (along < squared) & (np.abs(across) <= reach)
    points = (np.arange(POINTS) + 0.5) / POINTS - 0.5
    within = np.subtract.outer(points * east, points * south).ravel() / math.sqrt(squared)
    pods = curve(np.abs(np.add.outer(across[near], within)))
    cells = zip(dx[near].tolist(), dy[near].tolist(), pods.tolist(), strict=True)
    return {(x, y): pod for x, y, pod in cells if pod >= MIN_POD}


def strip(width: float) -> Curve:
    """Return the curve that is 1 up to half this width to each side and 0 beyond."""
    return lambda ranges: np.clip((width / 2 - ranges) * POINTS + 0.5, 0.0, 1.0).mean(axis=1)


def random_search(width: float, heading: tuple[int, int]) -> Pods:
    """Return the PODs by the random search formula, with the effort spread over the sweep width.

    Args:
        width: Sweep width.
        heading: See `beside`.
    """
    swept = strip(width)
    return beside(heading, width / 2 + 0.75, lambda ranges: -np.expm1(-swept(ranges)))


def inverse_cube(width: float, heading: tuple[int, int]) -> Pods:
    """Return the PODs by the inverse cube law, 1 - exp(-W^2 / (4 pi x^2)) at a lateral range x.

    The curve has no end: eight sweep widths to each side, or `REACH`, have most of it. The exposure
    beyond is spread evenly over the cells, as it is where many tracks are parallel.

    Args:
        width: Sweep width.
        heading: See `beside`.
    """
    reach = min(max(8 * width, 1.0), REACH)
    beyond = (width / (math.floor(reach) + 0.5)) ** 2

    def curve(ranges: NDArray[np.float64]) -> NDArray[np.float64]:
        exposures = (width / np.maximum(ranges, 1e-9)) ** 2 + beyond
        return -np.expm1(-exposures / (4 * math.pi)).mean(axis=1)

    return beside(heading, reach, curve)


LAWS = {"inverse_cube": inverse_cube, "random_search": random_search}
"""Laws of detection by name."""


def in_place(passes: tuple[Pods, Pods]) -> Pods:
    """Return the PODs of a search in place: half the effort of each of two passes."""
    cells = [*passes[0], *(cell for cell in passes[1] if cell not in passes[0])]
    missed = {cell: [1.0 - pods.get(cell, 0.0) for pods in passes] for cell in cells}
    return {cell: 1.0 - math.sqrt(math.prod(each)) for cell, each in missed.items()}

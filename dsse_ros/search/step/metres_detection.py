# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How likely a drone misses a person whom it passes, compiled: lateral range laws on paths.

A path is `pieces` straight pieces, flown at equal times while the person drifts on a straight line.
Positions are metres. A law depends only on the motion of the person relative to the drone.

With definite range, a person who comes within the reach is detected with the POD, once per pass;
what is in view as a drone begins to look has been passed once. With the inverse cube law (Koopman,
"Search and Screening", 1946) a person at the distance r is detected at the rate W^2 v / (8 pi r^3),
W the sweep width at the speed v: on a straight track this is 1 - exp(-W^2 / (4 pi x^2)) at the
lateral range x. The exposure of a path is the sum of those of its pieces.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import inlined, part
from dsse_ros.base.compiled.records import dtype_of
from dsse_ros.search.step.metres_paths import Path
from dsse_ros.world.sensors.lateral_range import LateralRange

DEFINITE, INVERSE_CUBE = range(2)


class Detector:
    """What a kind of drone sees of persons whom it passes."""

    law: int  # `DEFINITE` or `INVERSE_CUBE`
    reach: float  # greatest distance at which a person is seen, m
    pod: float  # definite range: POD of a pass
    rate: float  # inverse cube: rate of detection times r^3, m^3/s


DETECTORS = dtype_of(Detector)

Leg: TypeAlias = tuple[float, float, float, float]  # x, y before a step and x, y after it, metres

NEGLIGIBLE = 1e-4
"""Under the inverse cube law a drone does not see where the exposure of a step is smaller."""
FARTHEST_M = 1e6
"""A track that has ended jumps farther than this in a step: nobody is there to be seen."""
ROUNDING_M = 1.0
"""Positions are rounded: who is this far beyond a box, or from a cell, may be in it."""
_NEAREST_M = 1e-3
_STILL_M = 1e-6


def detectors_of(ranges: Iterable[LateralRange], step_s: float) -> NDArray[np.void]:
    """Return what each kind of drone sees, (K,) of `DETECTORS`."""
    detectors = []
    for lateral in ranges:
        if lateral.sweep_width_m:
            rate = lateral.sweep_width_m**2 * lateral.speed_mps / (8 * math.pi)
            detectors.append((INVERSE_CUBE, (rate * step_s / NEGLIGIBLE) ** (1 / 3), 0.0, rate))
        else:
            detectors.append((DEFINITE, lateral.reach_m, lateral.pod, 0.0))
    return np.array(detectors, DETECTORS)


@inlined
def farthest_reach(detectors: NDArray[np.void]) -> float:
    """Return the largest reach of detectors, (A,) of `DETECTORS`."""
    reach = 0.0
    for a in range(len(detectors)):
        reach = max(reach, detectors[a].reach)
    return reach


@part
def missed(
    detector: Detector,
    path: Path,
    looked: NDArray[np.bool_] | None,
    step_s: float,
    person: Leg,
    multiplier: float,
) -> float:
    """Return the probability that a drone does not detect a person in a step.

    Args:
        detector: One of `DETECTORS`.
        path: (K + 1, 2) float64, positions of the drone at equal times.
        looked: (K + 1,) bool, whether it looked right before the path and on each piece; None if it
            did.
        step_s: Time of the step.
        person: Position of the person before and after the step, (x, y, x, y).
        multiplier: Of the POD, or of the exposure.
    """
    if max(abs(person[2] - person[0]), abs(person[3] - person[1])) >= FARTHEST_M:
        return 1.0
    pieces = len(path) - 1
    x, y = person[0] - path[0, 0], person[1] - path[0, 1]
    drift_x, drift_y = (person[2] - person[0]) / pieces, (person[3] - person[1]) / pieces
    squared, passes, exposure = detector.reach * detector.reach, 0, 0.0
    for k in range(pieces):
        dx = drift_x - (path[k + 1, 0] - path[k, 0])
        dy = drift_y - (path[k + 1, 1] - path[k, 1])
        looks, looked_before = True, True
        if looked is not None:
            looks, looked_before = looked[k + 1], looked[k]
        if looks and detector.law == DEFINITE:
            if not looked_before and x * x + y * y <= squared:
                passes += 1
            passes += enters(x, y, dx, dy, squared)
        elif looks and math.hypot(x, y) <= detector.reach + math.hypot(dx, dy):
            exposure += nearness(x, y, dx, dy)
        x += dx
        y += dy
    if detector.law == DEFINITE:
        return (1.0 - min(detector.pod * multiplier, 1.0)) ** passes if passes > 0 else 1.0
    return math.exp(-detector.rate * step_s / pieces * multiplier * exposure)


@inlined
def middle_and_reach(path: Path, axis: int, reach: float) -> tuple[float, float]:
    """Return the middle of a path along an axis, and how far from it the drone may see."""
    low, high = path[0, axis], path[0, axis]
    for k in range(1, len(path)):
        low, high = min(low, path[k, axis]), max(high, path[k, axis])
    return (low + high) / 2, (high - low) / 2 + reach


@inlined
def is_far(reach: float, path: Path, person: Leg) -> bool:
    """Return whether a person is beyond the reach of a path along an axis; see `missed`."""
    for axis in range(2):
        middle, wide = middle_and_reach(path, axis, reach + ROUNDING_M)
        if max(person[axis], person[axis + 2]) < middle - wide:
            return True
        if min(person[axis], person[axis + 2]) > middle + wide:
            return True
    return False


@inlined
def enters(x: float, y: float, dx: float, dy: float, squared: float) -> bool:
    """Return whether a point (x, y) that moves by (dx, dy) comes into a circle from outside.

    Args:
        x: Of the point, from the centre of the circle.
        y: The same.
        dx: Motion of the point.
        dy: The same.
        squared: Square of the radius.
    """
    if x * x + y * y <= squared:
        return False
    along, length = -(x * dx + y * dy), dx * dx + dy * dy
    if along <= 0.0:
        return False
    if along < length:
        across = x * dy - y * dx
        return across * across <= squared * length
    x, y = x + dx, y + dy
    return x * x + y * y <= squared


@inlined
def nearness(x: float, y: float, dx: float, dy: float) -> float:
    """Return the mean of 1 / r^3 of a point (x, y) that moves by (dx, dy), r from the origin."""
    length = math.hypot(dx, dy)
    if length < _STILL_M:
        return 1.0 / max(math.hypot(x, y), _NEAREST_M) ** 3
    first = (x * dx + y * dy) / length
    last = first + length
    across = (x * dy - y * dx) / length
    lateral = max(across * across, _NEAREST_M * _NEAREST_M)
    if first * last <= 0.0:
        ends = last / math.sqrt(lateral + last * last) - first / math.sqrt(lateral + first * first)
        return ends / lateral / length
    # The difference of two numbers near 1, written without it.
    near, far = min(abs(first), abs(last)), max(abs(first), abs(last))
    at_near, at_far = math.sqrt(lateral + near * near), math.sqrt(lateral + far * far)
    ends = (far * far - near * near) / (at_near * at_far * (far * at_near + near * at_far))
    return ends / length

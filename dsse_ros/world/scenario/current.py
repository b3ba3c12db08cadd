# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Conversion between vectors and the speed of the datum under each rule of drift.

A vector of DSSE is not a speed under every rule: see `drift_by_speed` and `drift_remainder` of
`rules.SeaRules`, and `sea_map.drift` for the drift of a step.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from dsse_ros.base.fields import FieldError
from dsse_ros.world.scenario.rules import Rules

Vector: TypeAlias = tuple[float, float]

MAX_ERROR = 0.1
"""Largest error of the drift, as a share of the current."""

NO_DRIFT = 1e-300
"""Cells per step below which a drift is none; such numbers lose digits, and inverses overflow."""

MAX_ADDED = 10_000
"""Steps per cell up to which increments are summed as in `sea_map.drift`, because rounding may cost
one more step; for more steps, that is negligible."""


def mean_drift(rules: Rules, vector: Vector, drone_speed: float) -> Vector:
    """Return the mean drift of the datum in a step, in cells, away from the edges.

    Args:
        rules: Set the drift of a vector.
        vector: Vector of a scenario.
        drone_speed: Airspeed of the fastest drone, in m/s.
    """
    x, y = vector
    if rules.drift_by_speed:
        share = math.hypot(x, y) / drone_speed
        x, y = share * x, share * y
    if rules.drift_remainder == "dropped":
        return _whole_steps(x), _whole_steps(y)
    return x, y


def resolve_vector(
    rules: Rules,
    vector: Vector | None,
    speed: float | None,
    toward: float | None,
    drone_speed: float,
) -> Vector:
    """Return the vector of a scenario: the stated one, that of a current, or the rules' default.

    If remainders are dropped, a cell takes whole steps, and the vector gives the nearest possible
    current along each axis.

    Args:
        rules: Set the drift of a vector.
        vector: The stated vector, or None.
        speed: Speed of the current in m/s, or None.
        toward: Direction of the current, in degrees clockwise from north, or None.
        drone_speed: Airspeed of the fastest drone, in m/s.

    Raises:
        FieldError: If the values contradict each other, or no vector gives the current.
    """
    if speed is None and toward is None:
        return vector or rules.vector
    if speed is None or toward is None:
        raise FieldError("current_speed and current_toward belong together; give both")
    # A step lasts cell / drone_speed, so the cell cancels.
    cells, angle = speed / drone_speed, math.radians(toward)
    x, y = drift = (cells * math.sin(angle), -cells * math.cos(angle))
    if rules.drift_remainder == "dropped":
        x, y = _for_whole_steps(x), _for_whole_steps(y)
    of_current = vector_of_increment(rules, (x, y), drone_speed)
    nearest = mean_drift(rules, of_current, drone_speed)
    if vector is not None:
        tolerance = max(1e-9 * cells, NO_DRIFT)
        if math.dist(mean_drift(rules, vector, drone_speed), nearest) > tolerance:
            raise FieldError("vector and current_speed must agree; give only one")
        return vector
    if rules.drift_remainder == "less_one" and max(map(abs, drift)) > 1.0:
        raise FieldError(
            f"current_speed must be at most drone_speed ({drone_speed:g}) along each axis with "
            f"rules {rules.profile}, whose datum drifts by at most a cell per step, got {speed:g}"
        )
    if math.dist(drift, nearest) > MAX_ERROR * cells:
        raise FieldError(
            f"current_speed must be one that rules {rules.profile} can give, with whole steps per "
            f"cell, got {speed:g}; the nearest is {drone_speed * math.hypot(*nearest):.4g} m/s"
        )
    return of_current


def vector_of_increment(rules: Rules, increment: Vector, drone_speed: float) -> Vector:
    """Return the vector with this increment of the remainder, see `sea_map.drift_per_step`.

    Args:
        rules: Set the drift of a vector.
        increment: Increment per step to the east and to the south, in cells.
        drone_speed: Airspeed of the fastest drone, in m/s.
    """
    x, y = increment
    norm = math.hypot(x, y)
    if not rules.drift_by_speed or norm < NO_DRIFT:
        return x, y
    scale = math.sqrt(drone_speed / norm)
    return scale * x, scale * y


def _whole_steps(increment: float) -> float:
    """Return the mean drift of an axis that drops its remainder on reaching a cell."""
    size = abs(increment)
    if size * MAX_ADDED < 1.0:
        return increment
    added = np.cumsum(np.full(math.ceil(1.0 / size) + 1, size))
    steps = 1 + int(np.argmax(added >= 1.0))
    return math.copysign(int(added[steps - 1]) / steps, increment)


def _for_whole_steps(drift: float) -> float:
    """Return the increment whose `_whole_steps` is nearest to a drift."""
    size = abs(drift)
    if size * MAX_ADDED < 1.0:
        return drift
    # Choose the middle of all increments with this drift, so that rounding does not matter.
    if size >= 1.0:
        return math.copysign(round(size) + 0.5, drift)
    fewer = math.floor(1.0 / size)
    steps = min((fewer, fewer + 1), key=lambda count: abs(1.0 / count - size))
    return math.copysign(1.5 if steps == 1 else 1.0 / (steps - 0.5), drift)

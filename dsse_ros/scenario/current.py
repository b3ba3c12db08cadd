# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How fast the datum drifts under each rule of drift, and which vector makes it drift so.

A vector of DSSE is no speed under every rule: see `drift_by_speed` and `drift_remainder` of
`rules.SeaRules`, and `sea_map.drift` for what a step does.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from dsse_ros.scenario.fields import FieldError
from dsse_ros.scenario.rules import Rules

Vector: TypeAlias = tuple[float, float]

MAX_ERROR = 0.1
"""Share of a current by which the drift may miss it."""

MAX_ADDED = 10_000
"""Steps to a cell up to which they are added up as `sea_map.drift` does it, as roundings may cost
one more; beyond, that is nothing."""


def mean_drift(rules: Rules, vector: Vector, drone_speed: float) -> Vector:
    """Return how far the datum drifts in a step on average, in cells, away from the edges.

    Args:
        rules: Say how a vector drifts.
        vector: Of a scenario.
        drone_speed: Of the fastest drone, in m/s.
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
    """Return the vector of a scenario, by itself, by a current or by the rules.

    Where remainders are dropped, a cell takes whole steps: a current is the nearest one along each
    axis.

    Args:
        rules: Say how a vector drifts.
        vector: As stated, or None.
        speed: Of the current in m/s, or None.
        toward: Direction that it flows to, in degrees clockwise from north, or None.
        drone_speed: Of the fastest drone, in m/s.

    Raises:
        FieldError: If these contradict each other, or no vector drifts as the current flows.
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
        if math.dist(mean_drift(rules, vector, drone_speed), nearest) > 1e-9 * cells:
            raise FieldError("vector and current_speed state the same thing, not alike; give one")
        return vector
    where = f"current_speed: {speed:g} is not allowed with rules {rules.profile}, whose datum"
    if rules.drift_remainder == "less_one" and max(map(abs, drift)) > 1.0:
        raise FieldError(
            f"{where} drifts by a cell in a step at most; up to drone_speed ({drone_speed:g}) "
            "along each axis"
        )
    if math.dist(drift, nearest) > MAX_ERROR * cells:
        raise FieldError(
            f"{where} takes whole steps for a cell: the nearest current is "
            f"{drone_speed * math.hypot(*nearest):.4g} m/s; a slower one, or vector"
        )
    return of_current


def vector_of_increment(rules: Rules, increment: Vector, drone_speed: float) -> Vector:
    """Return the vector that adds this to the remainder in each step, see `sea_map.drift_per_step`.

    Args:
        rules: Say how a vector drifts.
        increment: To the east and to the south, in cells.
        drone_speed: Of the fastest drone, in m/s.
    """
    x, y = increment
    norm = math.hypot(x, y)
    if not rules.drift_by_speed or norm == 0.0:
        return x, y
    scale = math.sqrt(drone_speed / norm)
    return scale * x, scale * y


def _whole_steps(increment: float) -> float:
    """Return the drift of an axis whose remainder is dropped once it has reached a cell."""
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
    # In the middle of the increments that drift so, where no rounding matters.
    if size >= 1.0:
        return math.copysign(round(size) + 0.5, drift)
    fewer = math.floor(1.0 / size)
    steps = min((fewer, fewer + 1), key=lambda count: abs(1.0 / count - size))
    return math.copysign(1.5 if steps == 1 else 1.0 / (steps - 0.5), drift)

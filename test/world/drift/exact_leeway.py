# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Exact mean and standard deviation of the leeway's displacement in a constant wind.

Written from the equations of `dsse_ros.world.drift.leeway` for a plane, apart from the code.
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import NamedTuple

from dsse_ros.world.drift.leeway import LeewayClass

NORMAL = NormalDist()


class Displacement(NamedTuple):
    """Mean and standard deviation in metres, downwind and crosswind (positive to the right)."""

    down: float
    down_std: float
    cross: float
    cross_std: float


def exact(
    category: LeewayClass, wind_mps: float, jibing: float, step_s: float, time_s: float
) -> Displacement:
    slope, offset, std = category.downwind
    steps = round(time_s / step_s)
    mean = variance = 0.0
    if std:
        # A normal distribution cut off where the slope would be negative.
        cut = -20 * slope / std
        hazard = NORMAL.pdf(cut) / (1 - NORMAL.cdf(cut))
        mean, variance = hazard * std, std**2 * (1 + cut * hazard - hazard**2)
    share = wind_mps / 20 + 0.5
    down = 0.01 * (slope * wind_mps + offset + share * mean) * time_s
    down_std = 0.01 * share * math.sqrt(variance) * time_s
    # An object is s = +-1 on the right or the left, with this correlation from step to step.
    kept = 1 - 2 * (1 - (1 - jibing) ** (step_s / 3600))
    squares = steps + 2 * sum((steps - lag) * kept**lag for lag in range(1, steps))
    right, left = (cross_slope * wind_mps + cross_offset
                   for cross_slope, cross_offset, _ in (category.right, category.left))  # fmt: skip
    mean_speed, half = (right + left) / 2, (right - left) / 2
    mean_std, half_std = (
        (category.right.std_cmps + category.left.std_cmps) / 2,
        (category.right.std_cmps - category.left.std_cmps) / 2,
    )
    # In each step the speed is mean + half s + share z (mean_std + half_std s), z standard normal.
    spread = half**2 * squares + share**2 * (steps**2 * mean_std**2 + squares * half_std**2)
    cross = 0.01 * step_s * steps * mean_speed
    return Displacement(down, down_std, cross, 0.01 * step_s * math.sqrt(spread))

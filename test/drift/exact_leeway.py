# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Exact mean and standard deviation of the leeway's displacement in a constant wind.

Written from the equations of `dsse_ros.drift.leeway` for a plane, apart from the code.
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import NamedTuple

from dsse_ros.drift.leeway import LeewayClass

NORMAL = NormalDist()


class Displacement(NamedTuple):
    """Mean and standard deviation in metres, downwind and crosswind (positive to the left)."""

    down: float
    down_std: float
    cross: float
    cross_std: float


def exact(
    of: LeewayClass, wind_mps: float, jibing: float, step_s: float, time_s: float
) -> Displacement:
    slope, offset, std = of.downwind
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
    # The sum of the signs of a slope that jibes with this correlation from step to step.
    kept = 1 - 2 * (1 - (1 - jibing) ** (step_s / 3600))
    signs = sum(kept**i for i in range(steps))
    squares = steps + 2 * sum((steps - lag) * kept**lag for lag in range(1, steps))
    means, second = [], []
    for cross_slope, cross_offset, cross_std in (of.right, of.left):
        of_side = cross_slope * wind_mps * signs + cross_offset * steps
        spread = (cross_slope * wind_mps) ** 2 * (squares - signs**2)
        spread += (share * cross_std * steps) ** 2
        means.append(of_side)
        second.append(spread + of_side**2)
    cross = sum(means) / 2
    cross_std = math.sqrt(max(sum(second) / 2 - cross**2, 0.0))
    return Displacement(down, down_std, 0.01 * step_s * cross, 0.01 * step_s * cross_std)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Confidence intervals of means; `campaign.estimates` has those of shares."""

from __future__ import annotations

import math
from statistics import NormalDist

Interval = tuple[float, float]

LEVEL = 0.99


def quantile(level: float = LEVEL) -> float:
    """Return z so that a standard normal value lies within -z..z with this probability."""
    return NormalDist().inv_cdf(0.5 + level / 2)


def of_mean(mean: float, deviation: float, count: int, level: float = LEVEL) -> Interval:
    """Return the normal interval of a mean of `count` values with this standard deviation."""
    reach = quantile(level) * deviation / math.sqrt(count)
    return mean - reach, mean + reach


def contains(interval: Interval, value: float) -> bool:
    """Return whether the value lies in the interval."""
    return interval[0] <= value <= interval[1]

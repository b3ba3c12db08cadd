# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Estimates with confidence intervals, also for missions that share random draws.

Missions whose planners have drawn with the same seed are a cluster. The intervals assume that
clusters are independent, not missions. If each mission is its own cluster, they are the textbook
intervals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Values = NDArray[Any]
Labels = NDArray[np.int64]
"""(M,) the number of each mission's cluster, from 0."""


@dataclass(frozen=True)
class Estimate:
    """A number with its confidence interval."""

    value: float
    low: float
    high: float


def clusters(planner_seeds: NDArray[np.int64]) -> Labels:
    """Return the clusters of missions, see `mission_batches.PlayedMissions.planner_seeds`."""
    alone = -1 - np.arange(len(planner_seeds))
    seeds = np.where(planner_seeds < 0, alone, planner_seeds)
    return np.unique(seeds, return_inverse=True)[1].reshape(-1)


def _effective_count(labels: Labels) -> float:
    """Return how many clusters of one size would weigh as much as these (Kish 1965)."""
    sizes = np.bincount(labels).astype(float)
    return float(sizes.sum() ** 2 / (sizes**2).sum())


def _squares(values: Values, labels: Labels) -> float:
    return float((np.bincount(labels, values) ** 2).sum())


def _sum_of_squares(values: Values, by: tuple[Labels, ...]) -> float:
    """Return the squares of the clusters' sums; by two kinds, Cameron, Gelbach and Miller 2011."""
    each = [_squares(values, labels) for labels in by]
    if len(each) == 1:
        return each[0]
    both = np.unique(np.stack(by), axis=1, return_inverse=True)[1].reshape(-1)
    return max(*each, sum(each) - _squares(values, both))


def of_mean(values: Values, confidence: float, *by: Labels) -> Estimate:
    """Return a mean with its interval by Student's t, with clusters.

    With fewer than two clusters the interval is unbounded.

    Args:
        values: (M,).
        by: The clusters; of pairs those of both planners.
    """
    mean = float(values.mean())
    count = min(map(_effective_count, by))
    if count < 2:
        return Estimate(mean, -np.inf, np.inf)
    error = (_sum_of_squares(values - mean, by) * count / (count - 1)) ** 0.5 / len(values)
    reach = error * float(stats.t.ppf(0.5 + confidence / 2, count - 1))
    return Estimate(mean, mean - reach, mean + reach)


def _effective_size(hits: Values, confidence: float, labels: Labels) -> float:
    """Return the effective sample size for a share (Korn and Graubard 1998).

    If all values are equal, it is at most the number of clusters.
    """
    size, count = len(hits), _effective_count(labels)
    if count == size:
        return size
    if count < 2:
        return 1.0
    squares = size * float(hits.mean()) * (1 - float(hits.mean()))
    if not squares:
        return count
    spread = _squares(hits - hits.mean(), labels) * count / (count - 1)
    design_effect = max(1.0, spread / (squares * size / (size - 1)))
    level = 0.5 + confidence / 2
    quantiles = stats.t.ppf(level, size - 1) / stats.t.ppf(level, count - 1)
    return max(1.0, float(size / design_effect * quantiles**2))


def wilson(share: float, size: float, confidence: float) -> tuple[float, float]:
    """Return Wilson's interval (1927) of a share seen in `size` trials."""
    z = float(stats.norm.ppf(0.5 + confidence / 2))
    centre = (share + z * z / (2 * size)) / (1 + z * z / size)
    reach = z * (share * (1 - share) / size + z * z / (4 * size * size)) ** 0.5 / (1 + z * z / size)
    # Of none or all, a bound is the share itself, which rounding may miss.
    return max(0.0, min(share, centre - reach)), min(1.0, max(share, centre + reach))


def of_share(hits: NDArray[np.bool_], confidence: float, labels: Labels) -> Estimate:
    """Return a share with its Wilson interval, with the effective size of the clusters.

    With one cluster, the interval is that of one mission or wider, up to 0 to 1.
    """
    share, size = float(hits.mean()), _effective_size(hits, confidence, labels)
    if size < 2 <= len(hits):
        return Estimate(share, 0.0, 1.0)
    return Estimate(share, *wilson(share, size, confidence))


def of_share_difference(
    first: NDArray[np.bool_],
    second: NDArray[np.bool_],
    confidence: float,
    by: tuple[Labels, Labels],
) -> Estimate:
    """Return the difference of two shares of the same missions, with Newcombe's interval.

    It is method 10 of Newcombe 1998, which has a width where the missions do not differ, too. With
    clusters the shares have their effective sizes, and the interval holds that by Student's t.

    Args:
        first: (M,).
        second: (M,).
        by: The clusters of each.
    """
    share_of_first, share_of_second = (
        of_share(hits, confidence, labels) for hits, labels in zip((first, second), by, strict=True)
    )
    size = len(first)
    both, neither = float((first & second).sum()), float((~first & ~second).sum())
    only_first, only_second = float((first & ~second).sum()), float((~first & second).sum())
    product = both * neither - only_first * only_second
    product = max(product - size / 2, 0.0) if product > 0 else product
    hits = float(first.sum()), float(second.sum())
    squares = hits[0] * (size - hits[0]) * hits[1] * (size - hits[1])
    phi = product / squares**0.5 if squares else 0.0

    def reach(up: float, down: float) -> float:
        return float(max(up**2 - 2 * phi * up * down + down**2, 0.0) ** 0.5)

    value = share_of_first.value - share_of_second.value
    low = value - reach(
        share_of_first.value - share_of_first.low, share_of_second.high - share_of_second.value
    )
    high = value + reach(
        share_of_first.high - share_of_first.value, share_of_second.value - share_of_second.low
    )
    if any(_effective_count(labels) < len(labels) for labels in by):
        mean = of_mean(first.astype(float) - second, confidence, *by)
        low, high = min(low, mean.low), max(high, mean.high)
    return Estimate(value, max(low, -1.0), min(high, 1.0))


def of_median(values: Values, confidence: float, labels: Labels) -> Estimate:
    """Return a median with its distribution-free interval by order statistics.

    With clusters, the ranks are those of their effective size (Woodruff 1952).
    With too few values it spans all of them, at less than the confidence level.
    """
    ordered, count = np.sort(values), len(values)
    median = float(np.median(ordered))
    size = int(_effective_size(values <= median, confidence, labels))
    rank = max(int(stats.binom.ppf(0.5 - confidence / 2, size, 0.5)) - 1, 0)
    low = rank * count // size
    return Estimate(median, float(ordered[low]), float(ordered[count - 1 - low]))


def signs_p(signed: Values, *by: Labels) -> float:
    """Return the p-value of the sum of values as if their signs were random.

    By clusters it is the test of Durkalski et al. 2003 where the values are signs, and of Rosner,
    Glynn and Lee 2006 where they are signed ranks, each with Student's t in the normal's place;
    with fewer than two clusters 1.

    Args:
        signed: (M,), of pairs that do not differ 0.
        by: The clusters of both planners.
    """
    count = min(map(_effective_count, by))
    squares = _sum_of_squares(signed, by)
    if count < 2 or not squares:
        return 1.0
    return float(2 * stats.t.sf(abs(signed.sum()) / squares**0.5, count - 1))

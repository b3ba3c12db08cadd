# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Results of a campaign: estimates with confidence intervals, and comparisons of planners."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from dsse_ros.results.campaign.config import Campaign, Case
from dsse_ros.results.campaign.estimates import (
    Estimate,
    Labels,
    clusters,
    of_mean,
    of_median,
    of_share,
    of_share_difference,
    signs_p,
)

Floats = NDArray[np.float64]
QUARTERS = (0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class Played:
    """The M missions of a planner in a scenario.

    Attributes:
        planner: Its name.
        case: The scenario.
        seeds: (M,) int64.
        planner_seeds: (M,) int64, see `mission_batches.PlayedMissions`.
        found: (M,) bool, whether every person was found.
        steps: (M,) steps until the end; the limit if not every person was found.
        detection_s: (M,) mission time of the last find; infinite if a person was not found.
        path_length_m: (M,) distance that all drones flew.
        collisions: (M,) pairs of drones in the same cell after a step.
        drones_lost: (M,) drones that collided, left the grid or were withdrawn before the end.
    """

    planner: str
    case: Case
    seeds: NDArray[np.int64]
    planner_seeds: NDArray[np.int64]
    found: NDArray[np.bool_]
    steps: Floats
    detection_s: Floats
    path_length_m: Floats
    collisions: Floats
    drones_lost: Floats

    @cached_property
    def clusters(self) -> Labels:
        """Clusters of missions that share the planner's random draws."""
        return clusters(self.planner_seeds)


@dataclass(frozen=True)
class Measure:
    """One number of a planner in a scenario.

    Attributes:
        name: Name in files.
        label: Name on the page.
        unit: `share` (0 to 1), `s`, `m`, or "" for a count.
        meaning: Definition, and method of the interval.
        estimate: Called with the missions, the horizon in seconds and the confidence level.
    """

    name: str
    label: str
    unit: str
    meaning: str
    estimate: Callable[[Played, float, float], Estimate]


def restricted_s(played: Played, horizon_s: float) -> Floats:
    """Return the times to detection (M,), none longer than the horizon."""
    return np.minimum(played.detection_s, horizon_s)


MEASURES = (
    Measure(
        "found", "Found", "share", "Missions in which every person was found. Wilson interval.",
        lambda played, horizon_s, level: of_share(played.found, level, played.clusters),
    ),
    Measure(
        "steps_mean", "Steps, mean", "",
        "Steps until the end; a mission without a find counts with the step limit. Student's t.",
        lambda played, horizon_s, level: of_mean(played.steps, level, played.clusters),
    ),
    Measure(
        "steps_median", "Steps, median", "", "Median of the same. Order statistics.",
        lambda played, horizon_s, level: of_median(played.steps, level, played.clusters),
    ),
    Measure(
        "time_to_detection", "Restricted mean time to detection", "s",
        "Mean time until all are found, or the horizon if that comes first: the area under 1 - POS "
        "(Royston and Parmar 2013). Student's t.",
        lambda played, horizon_s, level: of_mean(
            restricted_s(played, horizon_s), level, played.clusters
        ),
    ),
    Measure(
        "path_length", "Path length, all drones", "m",
        "Sum of the distances between the centres of the cells flown through. Student's t.",
        lambda played, horizon_s, level: of_mean(played.path_length_m, level, played.clusters),
    ),
    Measure(
        "collisions", "Collisions", "",
        "Pairs of drones in the search that share a cell after a step, per mission. Student's t.",
        lambda played, horizon_s, level: of_mean(played.collisions, level, played.clusters),
    ),
    Measure(
        "drones_lost", "Drones lost", "",
        "Drones that have collided or left the grid when a search ends without finding everyone, "
        "per mission. Student's t.",
        lambda played, horizon_s, level: of_mean(played.drones_lost, level, played.clusters),
    ),
)  # fmt: skip


@dataclass(frozen=True)
class PlannerPair:
    """Two planners on the same seeds of a scenario; differences are of the first minus the second.

    Attributes:
        case: The scenario.
        first, second: Names of the planners.
        only_first, only_second: Missions in which only that one has found every person.
        found: Difference of the share of missions with all found.
        found_p: Of McNemar's exact test (McNemar 1947), adjusted; with clusters see `signs_p`.
        time_s: Difference of the restricted times to detection.
        time_p: Of Wilcoxon's signed-rank test on them (Wilcoxon 1945, zeros by Pratt), adjusted;
            with clusters see `signs_p`.
    """

    case: Case
    first: str
    second: str
    only_first: int
    only_second: int
    found: Estimate
    found_p: float
    time_s: Estimate
    time_p: float


def horizon_of(campaign: Campaign, case: Case) -> float:
    """Return the time that times to detection are restricted to, never beyond the step limit."""
    return min(campaign.settings.horizon_s or case.limit_s, case.limit_s)


def pos_times(campaign: Campaign, case: Case) -> list[float]:
    """Return the times at which the POS is stated, in seconds."""
    times_s = campaign.settings.pos_at_s
    return list(times_s or (case.limit_s * quarter for quarter in QUARTERS))


def pos_at(played: Played, time_s: float, confidence: float) -> Estimate:
    """Return the probability of success by a time: the share of missions that had found all."""
    # Times are sums of steps, which a decimal number may miss by a rounding error.
    return of_share(played.detection_s <= time_s * (1 + 1e-12), confidence, played.clusters)


def pairs(campaign: Campaign, missions: Sequence[Played]) -> Iterator[PlannerPair]:
    """Yield every two planners of each scenario.

    The p-values of each test are adjusted for all pairs of the scenario (Holm 1979).
    """
    level = campaign.settings.confidence
    for case in campaign.cases:
        horizon_s = horizon_of(campaign, case)
        both = list(combinations([played for played in missions if played.case is case], 2))
        times = [restricted_s(a, horizon_s) - restricted_s(b, horizon_s) for a, b in both]
        founds = [a.found.astype(float) - b.found.astype(float) for a, b in both]
        by = [(a.clusters, b.clusters) for a, b in both]
        found_p = holm([_mcnemar(*pair) for pair in zip(founds, by, strict=True)])
        time_p = holm([_wilcoxon(*pair) for pair in zip(times, by, strict=True)])
        for k, (a, b) in enumerate(both):
            yield PlannerPair(
                case, a.planner, b.planner,
                int((founds[k] > 0).sum()), int((founds[k] < 0).sum()),
                of_share_difference(a.found, b.found, level, by[k]), found_p[k],
                of_mean(times[k], level, *by[k]), time_p[k],
            )  # fmt: skip


def _independent(by: Sequence[Labels]) -> bool:
    return all(labels.max() + 1 == len(labels) for labels in by)


def _mcnemar(differences: Floats, by: Sequence[Labels]) -> float:
    if not _independent(by):
        return signs_p(differences, *by)
    discordant = int(np.count_nonzero(differences))
    only_first = int((differences > 0).sum())
    return float(stats.binomtest(only_first, discordant).pvalue) if discordant else 1.0


def _wilcoxon(differences: Floats, by: Sequence[Labels]) -> float:
    if not differences.any():
        return 1.0
    if not _independent(by):
        return signs_p(np.sign(differences) * stats.rankdata(abs(differences)), *by)
    return float(stats.wilcoxon(differences, zero_method="pratt", method="approx").pvalue)


def holm(p: Sequence[float]) -> list[float]:
    """Return p-values adjusted for their number by Holm's step-down procedure (Holm 1979)."""
    order = np.argsort(p)
    scaled = np.minimum(1.0, np.arange(len(p), 0, -1) * np.take(p, order))
    adjusted: list[float] = np.maximum.accumulate(scaled)[order.argsort()].tolist()
    return adjusted

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The coverage task of B worlds: the probability to cover, its uncovered rest, and metrics."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import FieldError
from dsse_ros.search.belief.forecasts import forecast_for
from dsse_ros.search.environments.world_ensemble import cells_of_maps
from dsse_ros.search.step.coverage_kernels import COVERAGE, CoverageTask
from dsse_ros.world.scenario.rules import Rules
from dsse_ros.world.scenario.scenario import ResolvedScenario

METRICS = ("coverage_rate", "repeated_coverage", "pos")
"""Names of the metrics: see `Coverage.metrics`."""

PARTICLES = 50_000
"""Particles of DSSE 1.1.9. A cell that would hold less than one particle needs no visit."""

_SUM_TOLERANCE = 1e-9
"""A matrix whose sum is this close to 1 stays unchanged, to the last bit."""


def poc_of(scenario: ResolvedScenario, rules: Rules) -> NDArray[np.float64]:
    """Return the probability of containment to cover, (R, C) as [y, x].

    It is the scenario's `probability_matrix`. Without one, it is the `belief.Belief` after the
    persons have moved for `reset_sea_steps` and `pre_search_minutes`. It is 0 outside the area,
    sums to 1, and is 0 where it is less than `cover_min_probability`.

    Raises:
        FieldError: If nothing is left.
    """
    if scenario.probability_matrix is not None:
        poc = scenario.probability_matrix.values.astype(np.float64)
    else:
        poc = forecast_for(scenario, rules).belief().poc()
        poc[poc < 1 / PARTICLES] = 0.0
    if scenario.area_mask is not None:
        poc[~scenario.area_mask] = 0.0
    total = float(poc.sum())
    if total > 0 and abs(total - 1.0) > _SUM_TOLERANCE:
        poc /= total
    poc[poc < rules.cover_min_probability] = 0.0
    if not poc.any():
        raise FieldError(
            "cover_min_probability must be at most that of the most probable cell of the area, got "
            f"{rules.cover_min_probability:g}"
        )
    return poc


class Coverage:
    """State of the coverage task in B worlds.

    Args:
        scenario: The scenario.
        rules: The rules of the search.
        num_worlds: B.

    Attributes:
        poc: (R, C) float64, see `poc_of`.
        left: (B, R, C) float64, the rest of `poc`; a visit removes the probability of its cell.
        records: (B,) of `coverage_kernels.COVERAGE`.

    Raises:
        FieldError: As `poc_of`.
    """

    def __init__(self, scenario: ResolvedScenario, rules: Rules, num_worlds: int) -> None:
        self.poc = poc_of(scenario, rules)
        self.left = np.zeros((num_worlds, *self.poc.shape))
        self.records = np.zeros(num_worlds, COVERAGE)
        self.left[:] = self.poc
        self.records["cells"] = np.count_nonzero(self.poc)

    @property
    def arrays(self) -> CoverageTask:
        """The task for the kernels."""
        return CoverageTask(poc=self.poc, left=self.left, records=self.records)

    def metrics(
        self, num_missing: NDArray[np.int64], which: Any = slice(None)
    ) -> dict[str, NDArray[np.float64]]:
        """Return the metrics of worlds by name, by default (B,) float64 each.

        `coverage_rate` is the share of the cells to cover that are covered. `repeated_coverage` is
        the number of visits to other cells, divided by the number of cells to cover. `pos` is the
        probability of the covered cells times the probability of detection.

        Args:
            num_missing: (B,) cells not covered yet.
            which: Index of the worlds.
        """
        records = self.records[which]
        cells = records["cells"]
        return {
            "coverage_rate": (cells - num_missing[which]) / cells,
            "repeated_coverage": records["repeated"] / cells,
            "pos": records["pos"].copy(),
        }

    def cells(self, x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return what is left of cells, (B, K) float32, 0 outside the grid; see `World.cells`."""
        return cells_of_maps(self.left, np.arange(len(self.left)), x, y).astype(np.float32)

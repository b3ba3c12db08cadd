# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The ensemble of a given map that drifts: a person may be in any of its cells."""

from __future__ import annotations

from typing import Any

import numpy as np

from dsse_ros.world.targets.ensemble import Ensemble, WeightedTracks


def tracks(scenario: Any, steps: int, rng: np.random.Generator, count: int) -> WeightedTracks:
    """Return one track for each cell of `probability_matrix`; see `targets.ensemble.TracksOf`.

    The track's weight is the probability of the cell. All tracks move together, from centre to
    centre of cells, by the mean drift of the datum (`drift`), rounded to whole cells. Nothing is
    drawn. Without a matrix, the prior is normal about the last known cell (`sigma_x`, `sigma_y`).
    """
    if scenario.probability_matrix is None:
        (x, y), grid = scenario.person_initial_position, scenario.grid_size
        across, along = np.arange(grid.columns) - x, np.arange(grid.rows) - y
        prior = np.outer(
            np.exp(-(along**2) / (2.0 * scenario.sigma_y**2)),
            np.exp(-(across**2) / (2.0 * scenario.sigma_x**2)),
        )
    else:
        prior = scenario.probability_matrix.values
    rows, cols = np.nonzero(prior)
    weights = prior[rows, cols] / prior.sum()
    # Positions on the edges of cells would not survive the conversion to metres and back.
    moved = np.floor(np.arange(steps + 1)[:, None] * np.array(scenario.drift) + 0.5)
    cells = np.stack([cols, rows], axis=1) + moved[:, None]
    return WeightedTracks((cells + 0.5) * scenario.cell_size, weights)


def count(scenario: Any) -> int:
    """Return the number of cells in which a person may start."""
    if scenario.probability_matrix is None:
        return int(scenario.grid_size.cells)
    return int(np.count_nonzero(scenario.probability_matrix.values))


DRIFTING_MAP = Ensemble(
    "starts in a cell of probability_matrix and drifts with the datum", tracks, count,
    reads=("probability_matrix",),
)  # fmt: skip

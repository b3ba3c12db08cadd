# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The most probable cells of a map, in one order for all planners and tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsse_ros.world.scenario.actions import Cell


def most_probable(probability: NDArray[np.float32], count: int) -> list[Cell]:
    """Return the `count` most probable cells (col, row), the best one last.

    These are the last `count` cells of a stable ascending sort row by row: among equally probable
    cells, the one further south, then further east, is better. NaN is the worst. The published
    greedy policy (`Greedy`) and every user of the datum share this order.

    Args:
        probability: Map (R, C).
        count: Number of cells, at most R * C.
    """
    flat = probability.ravel()
    parted = np.partition(flat, flat.size - count)[flat.size - count :]
    if np.isnan(parted).any():  # NaN sorts last, so one would be among the best
        return most_probable(np.nan_to_num(probability, nan=-np.inf), count)
    least = parted[0]
    above = np.flatnonzero(flat > least)
    equal = np.flatnonzero(flat == least)[above.size - count :]
    best = np.concatenate([equal, above[np.argsort(flat[above], kind="stable")]])
    rows, cols = np.divmod(best, probability.shape[1])
    return list(zip(cols.tolist(), rows.tolist(), strict=True))


def datum_of(probability: NDArray[np.float32]) -> Cell:
    """Return the most probable cell (col, row) of a map (R, C), as `most_probable`."""
    backwards = probability.ravel()[::-1]
    best = int(np.argmax(backwards))
    if np.isnan(backwards[best]):
        return datum_of(np.nan_to_num(probability, nan=-np.inf))
    row, col = divmod(backwards.size - 1 - best, probability.shape[1])
    return col, row

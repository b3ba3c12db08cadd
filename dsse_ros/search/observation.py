# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a drone observes, and where the map is most probable."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dsse_ros.search.actions import Cell
from dsse_ros.search.rules import Rules


class Observation(NamedTuple):
    """The observation of one drone.

    Attributes:
        position: (2,) integers, its cell (x, y).
        probability: (G, G) float32, the probability of cell [y, x].
    """

    position: NDArray[np.integer[Any]]
    probability: NDArray[np.float32]


AgentObservation = tuple[NDArray[np.integer[Any]], NDArray[np.float32]]
"""What an environment hands out for each agent: `Observation(*it)` has names."""


def observation_space(grid_size: int, rules: Rules) -> spaces.Tuple:  # type: ignore[type-arg]
    """Return the space of a drone's observations, for grid_size cells along a side."""
    span, first = [grid_size + 2 * rules.margin] * 2, [-rules.margin] * 2
    return spaces.Tuple(
        (
            spaces.MultiDiscrete(span, start=first),
            spaces.Box(0.0, 1.0, (grid_size, grid_size), np.float32),
        )
    )


def most_probable(probability: NDArray[np.float32], count: int) -> list[Cell]:
    """Return the count most probable cells (col, row), the best one last.

    The last `count` of a stable ascending sort of the cells row by row: of equally probable
    cells the one further south, then further east, counts as better. NaN is the worst. This is the
    order of the published greedy policy (`Greedy`), and whatever asks for the datum has it too.

    Args:
        probability: Map (G, G).
        count: At most G * G.
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

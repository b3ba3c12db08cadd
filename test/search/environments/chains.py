# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Markov chains on a grid, and their matrices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def uneven_chain(side: int, seed: int = 0) -> NDArray[np.float64]:
    """A chain (G, G, 9) of other probabilities in each cell, of which about half are 0."""
    rng = np.random.default_rng(seed)
    chain = rng.random((side, side, 9)) * (rng.random((side, side, 9)) < 0.5)
    chain[:, :, 4] += 0.1
    return np.asarray(chain / chain.sum(axis=2, keepdims=True))


def chain_of_walk(side: int, steps: Sequence[float]) -> NDArray[np.float64]:
    """The chain of a random walk, which shares out the steps that would leave the grid."""
    chain = np.zeros((side, side, 9))
    for row, col, step in np.ndindex(chain.shape):
        inside = 0 <= row + step // 3 - 1 < side and 0 <= col + step % 3 - 1 < side
        chain[row, col, step] = steps[step] if inside and step != 4 else 0.0
    # The order of these operations decides about the last bit.
    total = np.add.accumulate(chain, axis=2)[:, :, 8]
    chain *= ((1.0 - steps[4]) / total)[:, :, None]
    chain[:, :, 4] = 1.0 - np.add.accumulate(chain, axis=2)[:, :, 8]
    return chain


def matrix_of(
    chain: NDArray[np.float64], mask: NDArray[np.bool_] | None = None
) -> NDArray[np.float64]:
    """The matrix (G G, G G) [from, to] of a chain; steps off the grid or the mask stay."""
    side = len(chain)
    matrix = np.zeros((side * side, side * side))
    for row, col, step in np.ndindex(chain.shape):
        to_row, to_col = row + step // 3 - 1, col + step % 3 - 1
        inside = 0 <= to_row < side and 0 <= to_col < side
        if not inside or (mask is not None and not mask[to_row, to_col]):
            to_row, to_col = row, col
        matrix[row * side + col, to_row * side + to_col] += chain[row, col, step]
    return matrix

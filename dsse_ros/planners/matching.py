# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drones matched with cells of a map, each with a different one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray


def best_pairs(worth: NDArray[Any]) -> Iterator[tuple[int, int, int]]:
    """Yield the pair of greatest worth among the remaining drones and cells, again and again.

    Args:
        worth: (N, R, C) [drone, row, col], not negative where a drone may go; it is overwritten.

    Yields:
        drone, row, col; as long as a drone that remains may go to a cell that does.
    """
    for _ in range(min(len(worth), worth.shape[1] * worth.shape[2])):
        drone, row, col = map(int, np.unravel_index(int(np.argmax(worth)), worth.shape))
        if worth[drone, row, col] < 0.0:
            return
        yield drone, row, col
        worth[drone] = worth[:, row, col] = -1.0

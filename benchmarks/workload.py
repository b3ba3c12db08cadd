# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The common work: the start cells of the drones, and their actions drawn in advance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.sweep import shares
from dsse_ros.world.scenario.actions import ACTION_VECTORS

MAP_BYTES = 1 << 29
"""Maximum memory of the maps of one batch."""


def batch_size(grid_size: int) -> int:
    """Return the number of worlds in a batch: 1024, or fewer if their maps would be too large."""
    worlds = 1024
    while worlds * grid_size**2 * 4 > MAP_BYTES:
        worlds //= 2
    return worlds


def random_walks(
    grid_size: int, num_drones: int, action_names: Sequence[str], calls: int, worlds: int, seed: int
) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
    """Return random valid actions for drones that never leave the grid and never meet.

    Each drone has a block of the grid to itself, starts in its middle and stays in it, so that an
    episode lasts until its time limit, whatever the rules. One of A actions is
    a search, with A the number of actions; the others are allowed moves, equally likely.

    Args:
        grid_size: Cells along a side.
        num_drones: N, at most one per cell.
        action_names: Names of the actions by number.
        calls: Steps, K.
        worlds: Different walks, W.
        seed: Of the walks.

    Returns:
        Start cells (N, 2) as (x, y) and actions (K, W, N).
    """
    blocks = shares(GridShape.square(grid_size), num_drones)
    low = np.array([(cols.start, rows.start) for cols, rows in blocks])
    high = np.array([(cols.stop - 1, rows.stop - 1) for cols, rows in blocks])
    starts = (low + high) // 2
    search = list(action_names).index("search")
    vectors = np.array([ACTION_VECTORS[name] for name in action_names])
    rng = np.random.default_rng(seed)
    cells = np.repeat(starts[None], worlds, axis=0)
    actions = np.empty((calls, worlds, num_drones), np.int8)
    for call in range(calls):
        ends = cells[:, :, None] + vectors
        allowed = ((ends >= low[:, None]) & (ends <= high[:, None])).all(axis=-1)
        allowed[..., search] = False
        drawn = np.where(allowed, rng.random(allowed.shape), -1.0)
        chosen = drawn.argmax(axis=-1)
        searches = rng.random(chosen.shape) < 1 / len(action_names)
        chosen[searches | ~allowed.any(axis=-1)] = search
        actions[call] = chosen
        cells = cells + vectors[chosen]
    return starts, actions

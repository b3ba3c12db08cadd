# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled list of the looks of a step, for the update of beliefs."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import part
from dsse_ros.search.belief.motion_kernels import Ints
from dsse_ros.search.step.viewpoints import viewpoint_of


class StepDone(NamedTuple):
    """Worlds after a step, and the actions of the step.

    Attributes:
        batch: A `world_state.Batch` of B worlds, after the step.
        actions: (B, N) int8 of the step.
        live: (B, N) bool, the drones in the search before the step.
        over: (B,) bool, the worlds whose search had ended before the step.
    """

    batch: Any
    actions: NDArray[np.int8]
    live: NDArray[np.bool_]
    over: NDArray[np.bool_]


class LooksDone(NamedTuple):
    """The looks of a step of one mission, first those that found nobody.

    Attributes:
        seen: (Q, 2) int64, columns and rows of the cells, on the grid or off it.
        rows: (Q,) int64, the row of `pods` of each look.
        pods: (L, C) float64, POD by detection class.
        failed: Number of looks that found nobody.
        number: Number of looks, at most Q.
    """

    seen: NDArray[np.int64]
    rows: NDArray[np.int64]
    pods: NDArray[np.float64]
    failed: int
    number: int


@part
def list_looks(done: StepDone, b: int, seen: Ints, rows: Ints) -> tuple[int, int]:
    """Write the looks of world b: first those that found nobody, then the finds.

    Args:
        done: The worlds.
        b: Number of the world.
        seen: (Q, 2) int64 out, of `LooksDone`.
        rows: (Q,) int64 out, of `LooksDone`.

    Returns:
        Number of looks that found nobody, and number of looks.
    """
    entities, actions = done.batch.entities, done.actions[b]
    failed = count = 0
    for finds in (False, True):
        for n in range(len(actions)):
            drone, kind = entities.drones[b, n], entities.kinds[n]
            view = viewpoint_of(done.batch.extensions.viewpoints, drone, actions[n], b, n)
            acts = 0 <= view.action < done.batch.constants[0].num_actions
            if not done.live[b, n] or not acts:
                continue
            first, last = (
                entities.look_starts[kind, view.action],
                entities.look_starts[kind, view.action + 1],
            )
            for k in range(first, last):
                bit = (entities.finds[b, n] >> np.uint64(k - first)) & np.uint64(1)
                found = drone.found and bit > 0
                if found == finds:
                    seen[count, 0] = view.x + entities.look_offsets[k, 0]
                    seen[count, 1] = view.y + entities.look_offsets[k, 1]
                    rows[count] = k
                    count += 1
        if not finds:
            failed = count
    return failed, count

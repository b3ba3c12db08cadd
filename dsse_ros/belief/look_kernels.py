# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled list of the looks of a step, for the update of beliefs."""

from __future__ import annotations

import numpy as np

from dsse_ros.compiled.jit import part


@part
def list_looks(c, drones, finds, kinds, looks, offsets, actions, live, seen, rows):
    """Write the looks of a world's drones: first those that found nobody, then the finds.

    Args:
        c: The constants.
        drones: (N,) of `kernels.DRONES`, after the step.
        finds: (N,) of `kernels.Crew`.
        kinds: (N,) of `kernels.Crew`.
        looks: (K, A + 1) of `kernels.Crew`.
        offsets: (L, 2) of `kernels.Crew`.
        actions: (N,) int8 of the step.
        live: (N,) bool, the drones in the search before the step.
        seen: (Q, 2) int64 out, columns and rows, on the grid or off it.
        rows: (Q,) int64 out, the number of each look.

    Returns:
        Number of looks that found nobody, and number of looks.
    """
    failed = count = 0
    for turn in range(2):
        for n in range(len(drones)):
            if not live[n] or not 0 <= actions[n] < c.num_actions:
                continue
            d = drones[n]
            first, last = looks[kinds[n], actions[n]], looks[kinds[n], actions[n] + 1]
            for k in range(first, last):
                found = d.found and (finds[n] >> np.uint64(k - first)) & np.uint64(1) > 0
                if found == (turn == 1):
                    seen[count, 0], seen[count, 1] = d.x + offsets[k, 0], d.y + offsets[k, 1]
                    rows[count] = k
                    count += 1
        if turn == 0:
            failed = count
    return failed, count

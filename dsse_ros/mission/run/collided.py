# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A text of the drones of a mission that have collided, and of the cells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

_MOST = 3
"""Largest number of collisions that a line names."""


def nobody_left(names: Sequence[str], history: NDArray[Any], *, collide: bool) -> str:
    """Return a text: no drone is left in a mission, and these have collided in these cells.

    Args:
        names: Names of the N drones.
        history: (K, N) with the fields `col`, `row` and `terminated` after each step.
        collide: The rule `collisions`.
    """
    lines = []
    down = history["terminated"].astype(bool)
    cells = np.stack([history["col"], history["row"]], axis=-1)
    new = down & ~np.vstack([np.zeros_like(down[:1]), down[:-1]])
    for step in np.flatnonzero(new.sum(axis=1) > 1) if collide else ():
        drones = np.flatnonzero(new[step]).tolist()
        for cell in np.unique(cells[step, drones], axis=0):
            there = [names[i] for i in drones if (cells[step, i] == cell).all()]
            if len(there) > 1:
                who = f"{', '.join(there[:-1])} and {there[-1]}"
                lines.append(f"{who} collided in cell ({cell[0]}, {cell[1]})")
    if not lines:
        return "no drone left"
    shown, more = "; ".join(lines[:_MOST]), len(lines) - _MOST
    return f"no drone left: {shown}{f'; {more} more' if more > 0 else ''} (rule collisions)"

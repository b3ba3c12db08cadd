# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The contract of a motion: how persons move step by step, as the search and a belief need it.

A motion is two functions on the 3 x 3 window about a person. One draws a step, for the search; the
other writes how probable each step is, for a belief. A step has the number 3 (dy + 1) + dx + 1, 0
to 8. Arguments with the same names mean the same as in `sea_map`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

PERSONS = np.dtype(
    [
        ("x", "i8"),
        ("y", "i8"),
        ("pod_multiplier", "f8"),
        ("remainder_x", "f8"),  # own drift not yet moved, cells
        ("remainder_y", "f8"),
        ("drift_x", "f8"),  # own drift per step, cells
        ("drift_y", "f8"),
        ("found", "?"),
    ],
    align=True,
)

STEPS = 9
NO_STEP = 4
"""The number of the step that stays."""
STAND_STILL = -1
"""The direction of a drift that has not gathered a cell: its persons do not step at all."""

CHANCES = STEPS + 1
"""What a belief knows of a cell: how probable each step is, and what a person's own drift adds."""

SCRATCH = 100
"""Length of the scratch memory of `PersonMotion.chances`."""


class PersonMotion(NamedTuple):
    """How a person moves: two compiled functions that know the same law.

    `direction` is the step that the person's own drift has gathered, `NO_STEP` without one. As long
    as the drift has not gathered any, neither is called.

    Attributes:
        doc: What a person does, without a subject.
        move: move(c, w, gauss, area, person, direction) draws a step and does it. Every random draw
            is one of `draws`.
        chances: chances(c, area, x, y, window, out, scratch) writes the probability of each step of
            a person in the cell (x, y) to out (`CHANCES`,), and last what is added to that of
            `direction`, as `step_within` allows it. `window` (9,) has the probabilities of the
            cells that the steps lead to; `scratch` (`SCRATCH`,) is free to use.
        own_drift: Whether each person has a drift of its own, drawn at reset, and steps only when
            it has gathered a cell.
    """

    doc: str
    move: Any
    chances: Any
    own_drift: bool = False

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The contract of a motion: steps of persons, for the search and for a belief.

A motion is two functions on the 3 x 3 window around a person. One draws a step, for the search; the
other writes the probability of each step, for a belief. A step has the number 3 (dy + 1) + dx + 1,
0 to 8. Arguments are as in `sea_map`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

PERSONS = np.dtype(
    [
        ("x", "i8"),
        ("y", "i8"),
        ("pod_multiplier", "f8"),
        ("remainder_x", "f8"),  # own drift not yet applied, cells
        ("remainder_y", "f8"),
        ("drift_x", "f8"),  # own drift per step, cells
        ("drift_y", "f8"),
        ("found", "?"),
    ],
    align=True,
)

STEPS = 9
NO_STEP = 4
"""The number of the step (0, 0)."""
STAND_STILL = -1
"""The direction of a drift that has not accumulated to a cell: its persons do not move."""

CHANCES = STEPS + 1
"""Values per cell in a belief: the probability of each step, and the addition by own drift."""

SCRATCH = 100
"""Length of the scratch memory of `PersonMotion.chances`."""


def no_data(_scenario: Any) -> None:
    """Return that a motion needs no data."""


class PersonMotion(NamedTuple):
    """A motion model: two compiled functions with the same distribution.

    `direction` is the step accumulated by the person's own drift, `NO_STEP` without one. While the
    drift has not accumulated a step, neither function is called.

    Attributes:
        doc: Motion of a person, as a phrase without a subject.
        move: move(constants, world, sea, person, direction) draws a step and does it, using only
            the random draws of `draws`.
        chances: chances(constants, sea, x, y, window, out, scratch) writes the probability of each
            step of a person in the cell (x, y) to out (`CHANCES`,), and last the addition to that
            of `direction`, within the limits of `step_within`; of the sea it may use `area` and
            `data`. `window` (9,) has the probabilities of the cells that the steps lead to;
            `scratch` (`SCRATCH`,) is free to use.
        data: data(scenario) returns the array of a `ResolvedScenario` that both functions need, as
            `sea.data.<name of the motion>`; None without one.
        reads: Names of the arrays among the fields of a scenario that `data` reads.
        own_drift: Whether each person has its own drift, drawn at reset, and steps only when it has
            accumulated a cell.
    """

    doc: str
    move: Any
    chances: Any
    data: Callable[[Any], NDArray[Any] | None] = no_data
    reads: tuple[str, ...] = ()
    own_drift: bool = False

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The motion of DSSE 1.1.9: to a random cell of the window, preferably the one drifted to."""

from __future__ import annotations

from dsse_ros.base.compiled.draws import draw_unit
from dsse_ros.base.compiled.jit import part
from dsse_ros.world.targets.motion import STEPS, PersonMotion
from dsse_ros.world.targets.sea_map import cell_probability, grid_of, step_within

DRIFT_WEIGHT = 0.05
"""Added to the probability of the cell to which a person drifts (DSSE 1.1.9)."""


@part
def move_with_drift(constants, world, sea, person, direction):
    """Draw a person's step from the 3 x 3 window, with more weight on the drift's step."""
    total = DRIFT_WEIGHT
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            total += cell_probability(
                constants, world, sea.gauss, sea.area, person.x + dx, person.y + dy
            )
    left = draw_unit(world) * total
    drawn = direction
    for step in range(STEPS):
        dx, dy = step % 3 - 1, step // 3 - 1
        left -= cell_probability(
            constants, world, sea.gauss, sea.area, person.x + dx, person.y + dy
        )
        if step == direction:
            left -= DRIFT_WEIGHT
        if left < 0:
            drawn = step
            break
    dx, dy = drawn % 3 - 1, drawn // 3 - 1
    person.x, person.y = step_within(sea.area, grid_of(constants), person.x, person.y, dx, dy)


@part
def drift_chances(_constants, _sea, _x, _y, window, out, _scratch):
    """Write the probabilities of the steps of `move_with_drift`."""
    total = DRIFT_WEIGHT
    for step in range(STEPS):
        total += window[step]
    for step in range(STEPS):
        out[step] = window[step] / total
    out[STEPS] = DRIFT_WEIGHT / total


DRAWN_CELL = PersonMotion(
    "is drawn towards its own drift", move_with_drift, drift_chances, own_drift=True
)

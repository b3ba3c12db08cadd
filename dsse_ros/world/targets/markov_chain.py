# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""A Markov chain on the grid: the probabilities of the steps differ from cell to cell.

A person stays instead of leaving the area. Without a chain, persons walk as in `random_walk`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.draws import draw_unit
from dsse_ros.base.compiled.jit import part
from dsse_ros.world.targets.motion import NO_STEP, STEPS, PersonMotion
from dsse_ros.world.targets.random_walk import scale_of_steps, share_of_step
from dsse_ros.world.targets.sea_map import grid_of, is_inside, is_open


@part
def chance_of_move(constants, area, transitions, x, y, step):
    """Return the probability of a step to another cell, 0 if it leads out of the area."""
    grid = grid_of(constants)
    # A damaged snapshot can have a person off the grid.
    if step == NO_STEP or not is_inside(grid, x, y):
        return 0.0
    if not is_open(area, grid, x + step % 3 - 1, y + step // 3 - 1):
        return 0.0
    if transitions is None:
        scale = scale_of_steps(constants, area, x, y)
        return scale * share_of_step(constants, area, x, y, step)
    return transitions[y, x, step]


@part
def follow_chain(constants, world, sea, person, _direction):
    """Move a person by a step of the chain, or not at all."""
    x, y = person.x, person.y
    left = draw_unit(world)
    for step in range(STEPS):
        left -= chance_of_move(constants, sea.area, sea.data.markov_chain, x, y, step)
        if left < 0.0:
            person.x, person.y = x + step % 3 - 1, y + step // 3 - 1
            return


@part
def chain_chances(constants, sea, x, y, _window, out, _scratch):
    """Write the probabilities of the steps of `follow_chain`."""
    out[:] = 0.0
    moves = 0.0
    for step in range(STEPS):
        out[step] = chance_of_move(constants, sea.area, sea.data.markov_chain, x, y, step)
        moves += out[step]
    # Rounding may put a sum of probabilities above 1.
    out[NO_STEP] = max(1.0 - moves, 0.0)


def transitions(scenario: Any) -> NDArray[np.float64] | None:
    """Return the probabilities of the steps from each cell, (R, C, 9) [row, col, step], read-only.

    None if they are the same in all cells.
    """
    if scenario.transition_probabilities is None:
        return None
    values: NDArray[np.float64] = scenario.transition_probabilities.values.view()
    # A pickled array can be written to, and Numba would compile the kernels again for it.
    values.flags.writeable = False
    return values


MARKOV_CHAIN = PersonMotion(
    "follows a Markov chain by transition_probabilities", follow_chain, chain_chances,
    transitions, reads=("transition_probabilities",),
)  # fmt: skip

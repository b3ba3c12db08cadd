# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The random walk of search theory: a Markov chain on the grid, the same in each cell and step."""

from __future__ import annotations

from dsse_ros.base.compiled.draws import draw_unit
from dsse_ros.base.compiled.jit import part
from dsse_ros.world.targets.motion import NO_STEP, STEPS, PersonMotion
from dsse_ros.world.targets.sea_map import grid_of, is_open


@part
def share_of_step(constants, area, x, y, step):
    """Return the share of a step among those that leave the cell, 0 if it leads out."""
    if step == NO_STEP or not is_open(
        area, grid_of(constants), x + step % 3 - 1, y + step // 3 - 1
    ):
        return 0.0
    return constants.person_steps[step]


@part
def scale_of_steps(constants, area, x, y):
    """Return the factor that makes the shares probabilities, 0 if no step is possible."""
    total = 0.0
    for step in range(STEPS):
        total += share_of_step(constants, area, x, y, step)
    return (1.0 - constants.person_steps[NO_STEP]) / total if total > 0.0 else 0.0


@part
def walk(constants, world, sea, person, _direction):
    """Move a person by a random step, or not at all."""
    x, y = person.x, person.y
    left, scale = draw_unit(world), scale_of_steps(constants, sea.area, x, y)
    for step in range(STEPS):
        left -= scale * share_of_step(constants, sea.area, x, y, step)
        if left < 0.0:
            person.x, person.y = x + step % 3 - 1, y + step // 3 - 1
            return


@part
def walk_chances(constants, sea, x, y, _window, out, _scratch):
    """Write the probabilities of the steps of `walk`."""
    out[:] = 0.0
    scale, moves = scale_of_steps(constants, sea.area, x, y), 0.0
    for step in range(STEPS):
        out[step] = scale * share_of_step(constants, sea.area, x, y, step)
        moves += out[step]
    out[NO_STEP] = 1.0 - moves


RANDOM_WALK = PersonMotion("walks at random by person_steps", walk, walk_chances)

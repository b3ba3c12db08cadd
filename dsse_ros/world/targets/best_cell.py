# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The motion of the paper and of DSSE 0.1.13: to the best cell of a randomly weighted window."""

from __future__ import annotations

import numpy as np

from dsse_ros.base.compiled.draws import draw_below
from dsse_ros.base.compiled.jit import part
from dsse_ros.world.targets.motion import NO_STEP, STEPS, PersonMotion
from dsse_ros.world.targets.sea_map import cell_probability, grid_of, is_masked

FACTORS = 100
"""A cell of a person's window is weighted by U{1..100} / 100."""


@part
def move_to_best_cell(constants, world, sea, person, _direction):
    """Move a person to the best of the 3 x 3 window, each cell weighted by U{1..100} / 100."""
    best, best_dx, best_dy = 0.0, 0, 0
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            factor = (1 + draw_below(world, FACTORS)) / np.float64(FACTORS)
            weight = (
                cell_probability(
                    constants, world, sea.gauss, sea.area, person.x + dx, person.y + dy
                )
                * factor
            )
            if weight > best:
                best, best_dx, best_dy = weight, dx, dy
    if best == 0.0 and steps_to_north_west(constants, sea.area, person.x, person.y):
        best_dx = best_dy = -1
    person.x += best_dx
    person.y += best_dy


@part
def best_cell_chances(constants, sea, x, y, window, out, scratch):
    """Write the probabilities of the steps that can be the best one.

    A step is best if its weight times its factor exceeds the products of all steps before it and is
    at least those of all steps after it. For each factor, count the factors of the others that
    allow this.
    """
    candidates = 0
    out[:] = 0.0
    for step in range(STEPS):
        candidates += window[step] > 0.0
    if candidates == 0:
        out[0 if steps_to_north_west(constants, sea.area, x, y) else NO_STEP] = 1.0
        return
    for step in range(STEPS):
        weight = window[step]
        if weight <= 0.0:
            continue
        for k in range(FACTORS):
            scratch[k] = 1.0
        for other in range(STEPS):
            rival = window[other]
            if other == step or rival <= 0.0:
                continue
            later = other > step
            for k in range(FACTORS):
                best = weight * ((k + 1) / np.float64(FACTORS))
                # The quotient may be off by one, so compare the same products as the draw.
                guess = np.floor(min(best / rival, 1.0) * FACTORS)
                guess += (guess < FACTORS) & is_beaten(rival, guess + 1.0, best, later)
                guess -= (guess > 0.0) & (not is_beaten(rival, guess, best, later))
                scratch[k] *= guess / FACTORS
        for k in range(FACTORS):
            out[step] += scratch[k] / FACTORS


@part
def steps_to_north_west(constants, area, x, y):
    """Return whether a person in an all-zero window walks to the north-west."""
    return constants.person_walks_blind and not is_masked(area, grid_of(constants), x - 1, y - 1)


@part
def is_beaten(rival, factor, best, later):
    """Return whether a weight times this factor does not replace the best."""
    product = rival * (factor / np.float64(FACTORS))
    return (product < best) | (later & (product == best))


BEST_CELL = PersonMotion(
    "goes to the best cell of the window, weighted at random", move_to_best_cell, best_cell_chances
)

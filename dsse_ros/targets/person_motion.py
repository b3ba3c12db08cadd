# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""Where persons start and how they move, compiled: one entry of `MOTIONS` for each motion.

A motion is two functions on the 3 x 3 window about a person. One draws a step, for the search; the
other writes how probable each step is, for a belief. A step has the number 3 (dy + 1) + dx + 1, 0
to 8. Arguments with the same names mean the same as in `sea_map`.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from dsse_ros.compiled.draws import draw_below, draw_unit
from dsse_ros.compiled.jit import inlined, kernel, part
from dsse_ros.targets.sea_map import (
    cell_probability,
    drift_per_step,
    is_masked,
    less_one,
    step_within,
)

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


FACTORS = 100
"""A cell of a person's window is weighted by U{1..100} / 100."""


@part
def move_to_best_cell(c, w, gauss, area, person, _direction):
    """Move a person to the best of the 3 x 3 window, each cell weighted by U{1..100} / 100."""
    best, best_dx, best_dy = 0.0, 0, 0
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            factor = (1 + draw_below(w, FACTORS)) / np.float64(FACTORS)
            weight = cell_probability(c, w, gauss, area, person.x + dx, person.y + dy) * factor
            if weight > best:
                best, best_dx, best_dy = weight, dx, dy
    if best == 0.0 and walks_blind(c, area, person.x, person.y):
        best_dx = best_dy = -1
    person.x += best_dx
    person.y += best_dy


@part
def best_cell_chances(c, area, x, y, window, out, scratch):
    """Write the probabilities of the steps that can be the best one.

    A step is best if its weight times its factor exceeds those of all steps before it and is no
    less than those of all after it: for each factor, as many of the others' factors allow that.
    """
    candidates = 0
    out[:] = 0.0
    for step in range(STEPS):
        candidates += window[step] > 0.0
    if candidates == 0:
        out[0 if walks_blind(c, area, x, y) else NO_STEP] = 1.0
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
                # A quotient may be one off; the products are those of the draw.
                guess = np.floor(min(best / rival, 1.0) * FACTORS)
                guess += (guess < FACTORS) & is_beaten(rival, guess + 1.0, best, later)
                guess -= (guess > 0.0) & (not is_beaten(rival, guess, best, later))
                scratch[k] *= guess / FACTORS
        for k in range(FACTORS):
            out[step] += scratch[k] / FACTORS


@part
def walks_blind(c, area, x, y):
    """Return whether a person who sees no possible cell walks to the north-west."""
    return c.person_walks_blind and not is_masked(area, c.grid_size, x - 1, y - 1)


@part
def is_beaten(rival, factor, best, later):
    """Return whether a weight times this factor does not take the place of the best."""
    product = rival * (factor / np.float64(FACTORS))
    return (product < best) | (later & (product == best))


DRIFT_WEIGHT = 0.05
"""Added to the probability of the cell that a person drifts to (DSSE 1.1.9)."""


@part
def move_with_drift(c, w, gauss, area, person, direction):
    """Draw a person's step from the 3 x 3 window, more likely the one that it drifts."""
    total = DRIFT_WEIGHT
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            total += cell_probability(c, w, gauss, area, person.x + dx, person.y + dy)
    left = draw_unit(w) * total
    drawn = direction
    for step in range(STEPS):
        dx, dy = step % 3 - 1, step // 3 - 1
        left -= cell_probability(c, w, gauss, area, person.x + dx, person.y + dy)
        if step == direction:
            left -= DRIFT_WEIGHT
        if left < 0:
            drawn = step
            break
    dx, dy = drawn % 3 - 1, drawn // 3 - 1
    person.x, person.y = step_within(area, c.grid_size, person.x, person.y, dx, dy)


@part
def drift_chances(_c, _area, _x, _y, window, out, _scratch):
    """Write the probabilities of the steps that `move_with_drift` draws."""
    total = DRIFT_WEIGHT
    for step in range(STEPS):
        total += window[step]
    for step in range(STEPS):
        out[step] = window[step] / total
    out[STEPS] = DRIFT_WEIGHT / total


MOTIONS: dict[str, PersonMotion] = {
    "window": PersonMotion(
        "goes to the best cell of the window, weighted at random",
        move_to_best_cell,
        best_cell_chances,
    ),
    "drift": PersonMotion(
        "is drawn towards its own drift", move_with_drift, drift_chances, own_drift=True
    ),
}
"""The motions by name; `c.motion` is the number of the one in use."""


def of_motion(functions: Iterable[Any], number: int = 0) -> Any:
    """Return a compiled function that calls the one of these whose number `c.motion` is."""
    first, *others = functions
    if not others:
        return first
    rest = of_motion(others, number + 1)

    @inlined
    def call(c, *arguments):
        if c.motion == number:
            first(c, *arguments)
        else:
            rest(c, *arguments)

    return call


move_person = of_motion(motion.move for motion in MOTIONS.values())
step_chances = of_motion(motion.chances for motion in MOTIONS.values())


@kernel
def persons_step(c, w, gauss, area, persons):
    """Move every person that is not found yet."""
    for p in range(len(persons)):
        person = persons[p]
        if person.found and not c.found_persons_stay:
            continue
        direction = gathered_step(person) if c.own_drift else NO_STEP
        if direction != STAND_STILL:
            move_person(c, w, gauss, area, person, direction)


@part
def gathered_step(person):
    """Let a person's own drift go on for a step; returns what it had gathered to do before.

    That is the number of a step, or `STAND_STILL`. What is done is taken off the remainder.
    """
    reached = abs(person.remainder_x) >= 1 or abs(person.remainder_y) >= 1
    person.remainder_x += person.drift_x
    person.remainder_y += person.drift_y
    if not reached:
        return STAND_STILL
    # np.round rounds halves to even.
    dx, dy = np.sign(np.round(person.remainder_x)), np.sign(np.round(person.remainder_y))
    person.remainder_x = less_one(person.remainder_x)
    person.remainder_y = less_one(person.remainder_y)
    return 3 * (int(dy) + 1) + int(dx) + 1


DRIFT_RANGES = 4
"""Ranges of angles that a person's own drift is drawn from; see `own_drift`."""


@part
def own_drift(c, w, k, share):
    """Return the drift (x, y) of a person whose angle is `share` of the way along range k of 4.

    The mean of the vector and of a turned and scaled copy of it: the scale falls with the angle's
    distance from a right angle (measured on DSSE 1.1.9).
    """
    low = (0.0, 20.0, 300.0, 315.0)[k]
    high = (45.0, 55.0, 360.0, 360.0)[k]
    angle = np.radians(low + share * (high - low))
    scale = 0.5 + np.exp(-abs(angle - np.pi / 2) / np.pi)
    turned_x = scale * (np.cos(angle) * w.vector_x - np.sin(angle) * w.vector_y)
    turned_y = scale * (np.sin(angle) * w.vector_x + np.cos(angle) * w.vector_y)
    return drift_per_step(c, (w.vector_x + turned_x) / 2, (w.vector_y + turned_y) / 2)


@part
def draw_own_drift(c, w, person):
    """Draw a person's drift: each range of angles, and each angle in it, is as likely."""
    k = draw_below(w, DRIFT_RANGES)
    person.drift_x, person.drift_y = own_drift(c, w, k, draw_unit(w))


@part
def scatter_persons(c, w, area, persons, cells):
    """Put all but the first person in different cells within `person_scatter` of the start."""
    g, s = c.grid_size, c.person_scatter
    x0, y0 = max(w.start_x - s, 0), max(w.start_y - s, 0)
    width = min(w.start_x + s, g - 1) - x0 + 1
    height = min(w.start_y + s, g - 1) - y0 + 1
    count = start = 0
    for k in range(width * height):
        x, y = x0 + k % width, y0 + k // width
        if is_masked(area, g, x, y):
            continue
        if x == w.start_x and y == w.start_y:
            start = count
        cells[count] = k
        count += 1
    cells[0], cells[start] = cells[start], cells[0]
    for p in range(1, len(persons)):
        k = p + draw_below(w, count - p)
        cells[p], cells[k] = cells[k], cells[p]
        persons[p].x, persons[p].y = x0 + cells[p] % width, y0 + cells[p] // width

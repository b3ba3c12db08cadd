# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled step of many beliefs: update with the searches of each world, then motion.

Arrays are those of `belief_kernels` and `search_outcomes`, with a first axis of B worlds.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.belief.belief_kernels import (
    BOTTOM,
    FIRST_ROW,
    PITCH,
    TOP,
    Mass,
    Steps,
    close_classes,
    detectable,
    index_of,
    mass_of,
    search,
    step_at,
)
from dsse_ros.belief.layer_kernels import predict
from dsse_ros.belief.look_kernels import LooksDone, list_looks
from dsse_ros.belief.search_outcomes import (
    Persons,
    learn_outcome,
    mean_found,
    open_classes,
    weigh_classes,
)
from dsse_ros.compiled.jit import inlined, kernel, part
from dsse_ros.step.recipe import acts_at
from dsse_ros.targets.sea_map import Sea


@kernel
def learn(constants, mass, step, persons, looks, pos):
    """Update a belief with the looks of a step; return the new POS.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        mass: The belief, in and out.
        step: One of `belief_kernels.Steps`.
        persons: What is known of them, in and out.
        looks: A `look_kernels.LooksDone`.
        pos: The POS before the step.
    """
    if len(persons.missing) > 1:
        return learn_of_several(constants[0], mass, step, persons, looks, pos)
    return learn_of_one(constants[0], mass, step, looks, pos)


@part
def learn_of_several(constants, mass, step, persons, looks, pos):
    """Update the belief about several persons; see `learn`."""
    if looks.number == 0:
        return pos
    open_classes(persons, mass.totals)
    for q in range(looks.number):
        learn_outcome(constants, mass, step.apart, persons, looks, q)
    close_classes(constants, mass, step.chances)
    return mean_found(persons)


@part
def learn_of_one(constants, mass, step, looks, pos):
    """Update the belief about a single person; see `learn`."""
    for turn in range(2):
        taken, first = 0.0, looks.failed if turn == 1 else 0
        for q in range(first, looks.number if turn == 1 else looks.failed):
            x, y, pods = looks.seen[q, 0], looks.seen[q, 1], looks.pods[looks.rows[q]]
            if turn == 1 and constants.one_find_per_search:
                share = detectable(constants, mass, pods, x, y)
                pos += (1.0 - pos) * share / mass.totals[0]
            else:
                taken += search(constants, mass, pods, x, y)
        if taken > 0.0:
            pos += (1.0 - pos) * min(taken / mass.totals[0], 1.0)
            close_classes(constants, mass, step.chances)
    return pos


class Tables(NamedTuple):
    """Tables computed once for all missions of a scenario.

    Attributes:
        start: The belief at a mission's first observation.
        pods: (L, C) float64, POD of each look by detection class.
        class_of: (n,) int64, see `search_outcomes`.
        sea: Of the scenario.
        steps: Step s of the sea is at s % R.
        first_step: Steps of the sea before a mission's first observation.
    """

    start: Mass
    pods: NDArray[np.float64]
    class_of: NDArray[np.int64]
    sea: Sea
    steps: Steps
    first_step: int


class Beliefs(NamedTuple):
    """The beliefs of B worlds.

    Attributes:
        masses: Those of a `Mass`, with a first axis of B worlds.
        missing: (B, n) float64, see `search_outcomes`.
        unfound: (B, n) float64, see `search_outcomes`.
        pos: (B,) float64, the POS of all searches of the mission.
    """

    masses: Mass
    missing: NDArray[np.float64]
    unfound: NDArray[np.float64]
    pos: NDArray[np.float64]


class FollowScratch(NamedTuple):
    """Memory of a thread.

    Attributes:
        numbers: (`OF_CLASS`, C) float64, see `search_outcomes.Persons`.
        hazard: (n,) float64.
        seen: (Q, 2) int64, see `list_looks`, with room for all looks of a step.
        rows: (Q,) int64, of the same length.
        motion: Of `predict`; (0,) with an ensemble.
    """

    numbers: NDArray[np.float64]
    hazard: NDArray[np.float64]
    seen: NDArray[np.int64]
    rows: NDArray[np.int64]
    motion: NDArray[np.float64]


@inlined
def persons_of(beliefs, class_of, scratch, b):
    """Return what is known of the persons of world b."""
    return Persons(
        class_of, beliefs.missing[b], beliefs.unfound[b], scratch.numbers, scratch.hazard
    )


@inlined
def copy_rows(to, rows):
    """Copy an array with two axes."""
    for k in range(len(rows)):
        for i in range(rows.shape[1]):
            to[k, i] = rows[k, i]


@part
def restart(beliefs, start, b):
    """Set the belief of world b, and what is known of its persons, to the start of a mission."""
    mass = mass_of(beliefs.masses, b)
    if len(start.boxes) == 0:
        copy_rows(mass.layers, start.layers)
    for k in range(len(start.boxes)):
        box = start.boxes[k]
        first = (box[TOP] - box[FIRST_ROW]) * box[PITCH]
        for i in range(first, first + (box[BOTTOM] - box[TOP]) * box[PITCH]):
            mass.layers[k, i] = start.layers[k, i]
    copy_rows(mass.boxes, start.boxes)
    copy_rows(mass.cells, start.cells)
    for m in range(len(start.totals)):
        mass.totals[m] = start.totals[m]
    beliefs.missing[b, :] = 1.0
    beliefs.unfound[b, :] = 1.0
    beliefs.pos[b] = 0.0


@kernel
def follow_worlds(followed, tables, beliefs, scratch, first, last):
    """Update the beliefs of the worlds first..last - 1 after a step.

    Args:
        followed: A `look_kernels.Followed`.
        tables: Of the scenario.
        beliefs: In and out.
        scratch: Of the thread.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    constants = followed.batch.constants
    for b in range(first, last):
        if constants[0].auto_reset and followed.done[b]:
            restart(beliefs, tables.start, b)
            continue
        mass = mass_of(beliefs.masses, b)
        t = followed.batch.worlds[b].t - 1
        step = step_at(tables.steps, (tables.first_step + t) % len(tables.steps.directions))
        if acts_at(constants[0], t):
            failed, count = list_looks(followed, b, scratch.seen, scratch.rows)
            looks = LooksDone(scratch.seen, scratch.rows, tables.pods, failed, count)
            persons = persons_of(beliefs, tables.class_of, scratch, b)
            beliefs.pos[b] = learn(constants, mass, step, persons, looks, beliefs.pos[b])
        predict(constants, tables.sea, mass, step, scratch.motion)


@inlined
def add_weighted(sums, weight, cells):
    """Add cells to sums, both (G,), with a weight."""
    for x in range(len(sums)):
        sums[x] += weight * cells[x]


@inlined
def write_sums(sums, weight, cells, out):
    """Write what `add_weighted` would add up to."""
    for x in range(len(sums)):
        # Rounding may put a sum of shares below 0 or above 1.
        out[x] = min(max(sums[x] + weight * cells[x], 0.0), 1.0)


@kernel
def write_cells(constants, mass, class_of, missing, scratch, out):
    """Write the probability of every cell, out (G, G) as [y, x].

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        mass: The belief.
        class_of: (n,) int64, see `search_outcomes`.
        missing: (n,) float64, see `search_outcomes`.
        scratch: (C + G,) float64.
        out: The probabilities of the missing persons.
    """
    weights, sums = scratch[: len(mass.totals)], scratch[len(mass.totals) :]
    weigh_classes(class_of, missing, mass.totals, weights)
    last = len(weights) - 1
    sums[:] = 0.0
    for y in range(len(sums)):
        first = index_of(constants[0], 0, y)
        if last > 0:
            sums[:] = 0.0
        for m in range(last):
            add_weighted(sums, weights[m], mass.cells[m, first : first + len(sums)])
        write_sums(sums, weights[last], mass.cells[last, first : first + len(sums)], out[y])


@kernel
def write_beliefs(constants, beliefs, class_of, scratch, maps, first, last):
    """Write the probability of every cell of the worlds first..last - 1, (B, G, G) as [y, x].

    `scratch` is that of `write_cells`.
    """
    for b in range(first, last):
        mass = mass_of(beliefs.masses, b)
        write_cells(constants, mass, class_of, beliefs.missing[b], scratch, maps[b])

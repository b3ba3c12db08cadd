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
    NOTHING_LEFT,
    Steps,
    detectable,
    index_of,
    normalise,
    predict,
    search,
    step_at,
)
from dsse_ros.belief.look_kernels import LooksDone, list_looks
from dsse_ros.belief.search_outcomes import (
    Persons,
    close_classes,
    learn_outcome,
    mean_found,
    open_classes,
    weigh_classes,
)
from dsse_ros.compiled.jit import inlined, kernel, part
from dsse_ros.step.recipe import acts_at
from dsse_ros.targets.sea_map import Sea


@kernel
def learn(constants, belief, step, persons, looks, pos):
    """Update a belief with the looks of a step; return the new POS.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        belief: (C K, S S) float64, in and out.
        step: One of `belief_kernels.Steps`.
        persons: What is known of them, in and out.
        looks: A `look_kernels.LooksDone`.
        pos: The POS before the step.
    """
    if len(persons.missing) > 1:
        return learn_of_several(constants[0], belief, step, persons, looks, pos)
    return learn_of_one(constants[0], belief, step, looks, pos)


@part
def learn_of_several(constants, belief, step, persons, looks, pos):
    """Update the belief about several persons; see `learn`."""
    if looks.number == 0:
        return pos
    open_classes(persons)
    for q in range(looks.number):
        learn_outcome(constants, belief, step.apart, persons, looks, q)
    close_classes(belief, persons, step.chances)
    return mean_found(persons)


@part
def learn_of_one(constants, belief, step, looks, pos):
    """Update the belief about a single person; see `learn`."""
    for turn in range(2):
        taken, first = 0.0, looks.failed if turn == 1 else 0
        for q in range(first, looks.number if turn == 1 else looks.failed):
            x, y, pods = looks.seen[q, 0], looks.seen[q, 1], looks.pods[looks.rows[q]]
            if turn == 1 and constants.one_find_per_search:
                pos += (1.0 - pos) * detectable(constants, belief, pods, x, y)
            else:
                taken += search(constants, belief, pods, x, y)
        if taken > 0.0:
            pos += (1.0 - pos) * min(taken, 1.0)
            if normalise(belief) < NOTHING_LEFT:
                for k in range(len(belief)):
                    for i in range(belief.shape[1]):
                        belief[k, i] = step.chances[i]
                normalise(belief)
    return pos


class Tables(NamedTuple):
    """Tables computed once for all missions of a scenario.

    Attributes:
        start: (C K, S S) float64, the belief at a mission's first observation.
        pods: (L, C) float64, POD of each look by detection class.
        class_of: (n,) int64, see `search_outcomes`.
        sea: Of the scenario.
        steps: Step s of the sea is at s % R.
        first_step: Steps of the sea before a mission's first observation.
    """

    start: NDArray[np.float64]
    pods: NDArray[np.float64]
    class_of: NDArray[np.int64]
    sea: Sea
    steps: Steps
    first_step: int


class Beliefs(NamedTuple):
    """The beliefs of B worlds.

    Attributes:
        beliefs: (B, C K, S S) float64; of an ensemble, (B, C, M), see `particle_kernels`.
        missing: (B, n) float64, see `search_outcomes`.
        unfound: (B, n) float64, see `search_outcomes`.
        pos: (B,) float64, the POS of all searches of the mission.
    """

    beliefs: NDArray[np.float64]
    missing: NDArray[np.float64]
    unfound: NDArray[np.float64]
    pos: NDArray[np.float64]


class Scratch(NamedTuple):
    """Memory of a thread.

    Attributes:
        numbers: (`OF_CLASS`, C) float64, see `search_outcomes.Persons`.
        hazard: (n,) float64.
        seen: (Q, 2) int64, see `list_looks`, with room for all looks of a step.
        rows: (Q,) int64, of the same length.
        motion: (S S + `ROW`,) float64, see `predict`; (0,) with an ensemble.
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
def forget(beliefs, b):
    """Set what is known of the persons of world b to the start of a mission."""
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
    constants, start = followed.batch.constants, tables.start
    for b in range(first, last):
        belief = beliefs.beliefs[b]
        if constants[0].auto_reset and followed.done[b]:
            for k in range(len(start)):
                for i in range(start.shape[1]):
                    belief[k, i] = start[k, i]
            forget(beliefs, b)
            continue
        t = followed.batch.worlds[b].t - 1
        step = step_at(tables.steps, (tables.first_step + t) % len(tables.steps.directions))
        if acts_at(constants[0], t):
            failed, count = list_looks(followed, b, scratch.seen, scratch.rows)
            looks = LooksDone(scratch.seen, scratch.rows, tables.pods, failed, count)
            persons = persons_of(beliefs, tables.class_of, scratch, b)
            beliefs.pos[b] = learn(constants, belief, step, persons, looks, beliefs.pos[b])
        predict(constants, tables.sea, belief, step, scratch.motion)


@kernel
def write_cells(constants, belief, class_of, missing, weights, out):
    """Write the probability of every cell, out (G, G) float64 as [y, x].

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        belief: (C K, S S) float64.
        class_of: (n,) int64, see `search_outcomes`.
        missing: (n,) float64, see `search_outcomes`.
        weights: (C,) float64 scratch.
        out: The probabilities of the missing persons.
    """
    grid_size, drifts = constants[0].grid_size, len(belief) // len(weights)
    weigh_classes(class_of, missing, weights)
    for y in range(grid_size):
        for x in range(grid_size):
            out[y, x] = 0.0
    for k in range(len(belief)):
        for y in range(grid_size):
            for x in range(grid_size):
                out[y, x] += weights[k // drifts] * belief[k, index_of(constants[0], x, y)]


@kernel
def write_beliefs(constants, beliefs, class_of, weights, scratch, maps, first, last):
    """Write the probability of every cell of the worlds first..last - 1, (B, G, G) as [y, x].

    `weights` (C,) and `scratch` (G, G) are float64 scratch.
    """
    for b in range(first, last):
        write_cells(constants, beliefs.beliefs[b], class_of, beliefs.missing[b], weights, scratch)
        for y in range(len(scratch)):
            for x in range(len(scratch)):
                # Rounding may put a sum of shares above 1.
                maps[b, y, x] = min(scratch[y, x], 1.0)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled filter of an ensemble: searches change the weights of its particles.

Weights are (C, M) float64: row m is for the persons of detection class m, and sums to their share
of all persons. Persons move independently: nobody is `APART`. Other arguments are as in
`search_outcomes`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.belief.belief_kernels import MARGIN, NOTHING_LEFT, total_of
from dsse_ros.belief.follow_kernels import forget, persons_of
from dsse_ros.belief.look_kernels import LooksDone, list_looks
from dsse_ros.belief.search_outcomes import (
    APART,
    LEFT_MIXED,
    MIXED,
    TOTAL,
    conclude,
    mean_found,
    open_classes,
    weigh_classes,
)
from dsse_ros.compiled.jit import compiled, inlined, kernel, part
from dsse_ros.step.recipe import acts_at
from dsse_ros.targets.sea_map import is_inside, is_open


class Particles(NamedTuple):
    """The particles of an ensemble by step of the sea, or at one: then there is no axis T.

    Attributes:
        area: Of `sea_map.Sea`.
        cells: (T, M, 2) int16, (col, row); after the last step nothing moves.
        prior: (M,) float64, the weights of the ensemble, which sum to 1.
    """

    area: NDArray[np.bool_] | None
    cells: NDArray[np.int16]
    prior: NDArray[np.float64]

    def at(self, row: int) -> Particles:
        """Return the particles at one step."""
        return self._replace(cells=self.cells[row])


class Links(NamedTuple):
    """Scratch memory for the particles of the cells that the looks of a step see.

    A pass over the particles links them, so that a look visits no others.

    Attributes:
        heads: (G G + 1,) int32, zeros in and out: the first particle of each cell plus one, or -1.
        after: (M,) int32: the next particle of the same cell plus one, or -1.
    """

    heads: NDArray[np.int32]
    after: NDArray[np.int32]


@inlined
def particles_at(particles, step):
    """Return the particles at a step of the sea."""
    cells = particles.cells[min(step, len(particles.cells) - 1)]
    return Particles(particles.area, cells, particles.prior)


@part
def link(constants, particles, links, looks):
    """Link the particles of each cell that the looks see, in their order."""
    g, area, seen = constants.grid_size, particles.area, looks.seen
    heads, after, cells = links.heads, links.after, particles.cells
    for q in range(looks.number):
        if is_open(area, g, seen[q, 0], seen[q, 1]):
            heads[seen[q, 1] * g + seen[q, 0]] = -1
    for k in range(len(cells) - 1, -1, -1):
        col, row = np.int64(cells[k, 0]), np.int64(cells[k, 1])
        # Without a branch, which would often be predicted wrongly.
        cell = row * g + col if is_inside(g, col, row) else g * g
        head = heads[cell]
        if head != 0:
            after[k] = head
            heads[cell] = k + 1


@part
def unlink(constants, particles, links, looks):
    """Set `heads` to zeros again."""
    g, seen = constants.grid_size, looks.seen
    for q in range(looks.number):
        if is_open(particles.area, g, seen[q, 0], seen[q, 1]):
            links.heads[seen[q, 1] * g + seen[q, 0]] = 0


@part
def learn_look(constants, particles, links, weights, persons, looks, q):
    """Update the weights with the outcome of look q.

    Call it for all looks of a step between `open_classes` and `close_weights`. A look off the grid
    or outside the area has no effect.

    Args:
        constants: As in `search_outcomes`.
        particles: Now.
        links: Of `link`.
        weights: (C, M) float64, in and out.
        persons: As in `search_outcomes`.
        looks: A `look_kernels.LooksDone`.
        q: Number of the look.
    """
    x, y, pods = looks.seen[q, 0], looks.seen[q, 1], looks.pods[looks.rows[q]]
    if not is_open(particles.area, constants.grid_size, x, y):
        return
    numbers, after = persons.numbers, links.after
    first = links.heads[y * constants.grid_size + x]
    for m in range(len(pods)):
        here, k = 0.0, first
        while k > 0:
            here += weights[m, k - 1]
            k = after[k - 1]
        numbers[APART, m] = 0.0
        numbers[MIXED, m] = here / numbers[TOTAL, m] if numbers[TOTAL, m] > 0.0 else 0.0
    if not conclude(constants, pods, persons, q >= looks.failed):
        return
    if len(persons.missing) == 1:
        # A single person counts as missing until the mission is over.
        persons.missing[0] = 1.0
    for m in range(len(pods)):
        k = first
        while k > 0:
            weights[m, k - 1] *= numbers[LEFT_MIXED, m]
            k = after[k - 1]


@part
def close_weights(weights, persons, prior):
    """Scale each class to its share of all persons; an empty class restarts from `prior`."""
    open_classes(persons)
    for m in range(len(weights)):
        share, total = persons.numbers[TOTAL, m], total_of(weights[m])
        if total < NOTHING_LEFT * share:
            for k in range(len(prior)):
                weights[m, k] = prior[k]
            total = total_of(prior)
        scale = share / total
        for k in range(len(prior)):
            weights[m, k] *= scale


@part
def restart(weights, persons, prior, beliefs, b):
    """Set the weights of world b, and what is known of its persons, to the start of a mission."""
    open_classes(persons)
    for m in range(len(weights)):
        for k in range(len(prior)):
            weights[m, k] = persons.numbers[TOTAL, m] * prior[k]
    forget(beliefs, b)


@kernel
def learn(constants, particles, links, weights, persons, looks, pos):
    """Update the weights with the looks of a step; return the new POS.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        particles: At the step.
        links: Scratch.
        weights: (C, M) float64, in and out.
        persons: As in `search_outcomes`, in and out.
        looks: A `look_kernels.LooksDone`.
        pos: The POS before the step.
    """
    if looks.number == 0:
        return pos
    open_classes(persons)
    link(constants[0], particles, links, looks)
    for q in range(looks.number):
        learn_look(constants[0], particles, links, weights, persons, looks, q)
    unlink(constants[0], particles, links, looks)
    close_weights(weights, persons, particles.prior)
    return mean_found(persons)


@kernel
def write_poc(constants, particles, weights, class_of, missing, scale, out):
    """Write the missing persons' probability of every cell, out (G, G) as [y, x].

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        particles: At one step; outside the area nothing is written.
        weights: (C, M) float64.
        class_of: (n,) int64.
        missing: (n,) float64.
        scale: (C,) float64 scratch.
        out: Out.
    """
    g, cells = constants[0].grid_size, particles.cells
    weigh_classes(class_of, missing, scale)
    for y in range(g):
        for x in range(g):
            out[y, x] = 0.0
    for m in range(len(weights)):
        for k in range(len(cells)):
            col, row = np.int64(cells[k, 0]), np.int64(cells[k, 1])
            if is_open(particles.area, g, col, row):
                out[row, col] += scale[m] * weights[m, k]


class ParticleTables(NamedTuple):
    """Tables computed once for all missions of a scenario.

    Attributes:
        particles: By step of the sea.
        pods: (L, C) float64, POD of each look by detection class.
        class_of: (n,) int64, see `search_outcomes`.
        first_step: Steps of the sea before a mission's first observation.
    """

    particles: Particles
    pods: NDArray[np.float64]
    class_of: NDArray[np.int64]
    first_step: int


@kernel
def follow_particles(followed, tables, beliefs, scratch, links, first, last):
    """Update the beliefs of the worlds first..last - 1 after a step.

    Args:
        followed: A `look_kernels.Followed`.
        tables: Of the scenario.
        beliefs: A `follow_kernels.Beliefs`, in and out.
        scratch: A `follow_kernels.Scratch`.
        links: Scratch.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    constants, prior = followed.batch.constants, tables.particles.prior
    for b in range(first, last):
        weights = beliefs.beliefs[b]
        persons = persons_of(beliefs, tables.class_of, scratch, b)
        if constants[0].auto_reset and followed.done[b]:
            restart(weights, persons, prior, beliefs, b)
            continue
        t = followed.batch.worlds[b].t - 1
        if not acts_at(constants[0], t):
            continue
        particles = particles_at(tables.particles, tables.first_step + t)
        failed, count = list_looks(followed, b, scratch.seen, scratch.rows)
        looks = LooksDone(scratch.seen, scratch.rows, tables.pods, failed, count)
        beliefs.pos[b] = learn(constants, particles, links, weights, persons, looks, beliefs.pos[b])


@kernel
def write_particles(constants, worlds, tables, beliefs, scale, maps, first, last):
    """Write the probability of every cell of the worlds first..last - 1, (B, G, G) as [y, x].

    `worlds` are (B,) of `kernels.WORLDS`; the other arguments are those of `follow_particles` and
    `write_poc`.
    """
    for b in range(first, last):
        t = tables.first_step + worlds[b].t
        particles = particles_at(tables.particles, t)
        weights, missing = beliefs.beliefs[b], beliefs.missing[b]
        write_poc(constants, particles, weights, tables.class_of, missing, scale, maps[b])
        for y in range(constants[0].grid_size):
            for x in range(constants[0].grid_size):
                # Rounding may put a sum of shares above 1.
                maps[b, y, x] = min(maps[b, y, x], 1.0)


@compiled()
def expect_particles(by_column, weights, looks, first, horizon, gamma, grid_size, left):
    """Return the discounted finds of future looks, exactly for the particles.

    Args:
        by_column: (T, S S + 1) int32 and (T, M) int32, the particles sorted by column, see
            `future_kernels.index`; after the last step of the sea nothing moves.
        weights: (C, M) float64, of the missing persons.
        looks: A `LooksToCome` with PODs (Q, C) by detection class.
        first: Step of the sea now.
        horizon: H.
        gamma: Discount per step.
        grid_size: G.
        left: (S S,) float64 out, final distribution of the persons not found.
    """
    starts, members = by_column
    steps, looked, pods = looks
    kept = weights.copy()
    side = grid_size + 2 * MARGIN
    last = len(members) - 1
    worth, value, q = 1.0, 0.0, 0
    for h in range(horizon):
        start, member = starts[min(first + h, last)], members[min(first + h, last)]
        while q < len(steps) and steps[q] == h:
            cell = looked[q]
            x, y = cell % side - MARGIN, cell // side - MARGIN
            if 0 <= x < grid_size and 0 <= y < grid_size:
                for k in member[start[cell] : start[cell + 1]]:
                    for m in range(len(kept)):
                        taken = kept[m, k] * pods[q, m]
                        kept[m, k] -= taken
                        value += worth * taken
            q += 1
        worth *= gamma
    start, member = starts[min(first + horizon, last)], members[min(first + horizon, last)]
    for cell in range(len(left)):
        left[cell] = 0.0
        for k in member[start[cell] : start[cell + 1]]:
            for m in range(len(kept)):
                left[cell] += kept[m, k]
    return value

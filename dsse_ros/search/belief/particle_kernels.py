# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled filter of an ensemble: searches change the weights of its particles.

The weights are the components of a `Mass`, one for each detection class. Persons move
independently: nobody is `APART`. Other arguments are as in `search_outcomes`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import compiled, expanded, kernel, part
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.belief.component_kernels import (
    FADED,
    NOTHING_LEFT,
    Mass,
    mass_of,
    total_of,
)
from dsse_ros.search.belief.filter_kernels import Beliefs, FilterScratch, persons_of, restart
from dsse_ros.search.belief.look_kernels import LooksDone, StepDone, list_looks
from dsse_ros.search.belief.motion_kernels import MARGIN, Floats, Ints, index_of
from dsse_ros.search.belief.protocol import Expected, LooksToCome
from dsse_ros.search.belief.search_outcomes import (
    APART,
    KEPT_MIXED,
    MIXED,
    TAKEN_MIXED,
    TOTAL,
    Persons,
    conclude,
    mean_found,
    open_classes,
    weigh_classes,
)
from dsse_ros.search.step.constants import Constants
from dsse_ros.search.step.recipe import acts_at
from dsse_ros.world.targets.sea_map import grid_of, is_inside


class BinnedParticles(NamedTuple):
    """The particles of an ensemble by step of the sea, or at one: then there is no axis T.

    Attributes:
        starts: (T, S + 1) int32; after the last step nothing moves.
        members: (T, M) int32; those in column i are members[starts[i] : starts[i + 1]], in
            increasing order. Those outside the area are in column 0.
        prior: (M,) float64, the weights of the ensemble, which sum to 1.
        appearances: (M,) int8, number of each particle's appearance.
    """

    starts: NDArray[np.int32]
    members: NDArray[np.int32]
    prior: NDArray[np.float64]
    appearances: NDArray[np.int8]

    def at(self, row: int) -> BinnedParticles:
        """Return the particles at one step."""
        return self._replace(starts=self.starts[row], members=self.members[row])


@expanded
def particles_at(particles: BinnedParticles, step: int) -> BinnedParticles:
    """Return the particles at a step of the sea."""
    row = min(step, len(particles.starts) - 1)
    return BinnedParticles(
        starts=particles.starts[row],
        members=particles.members[row],
        prior=particles.prior,
        appearances=particles.appearances,
    )


@expanded
def those_in(particles: BinnedParticles, i: int) -> NDArray[np.int32]:
    """Return the numbers of the particles in a column, at one step."""
    return particles.members[particles.starts[i] : particles.starts[i + 1]]


@part
def learn_look(
    constants: Constants,
    particles: BinnedParticles,
    mass: Mass,
    persons: Persons,
    looks: LooksDone,
    q: int,
) -> None:
    """Update the weights with the outcome of look q.

    Call it for all looks of a step between `open_classes` and `close_weights`. A look off the grid
    or outside the area has no effect.
    """
    x, y, pods = looks.seen[q, 0], looks.seen[q, 1], looks.pods[looks.rows[q]]
    if not is_inside(grid_of(constants), x, y):
        return
    numbers, weights = persons.numbers, mass.components
    classes = len(weights)
    by_appearance = len(pods) > classes
    seen = those_in(particles, index_of(constants, x, y))
    for m in range(classes):
        here = 0.0
        for k in seen:
            pod = pods[particles.appearances[k] * classes + m] if by_appearance else 1.0
            here += weights[m, k] * pod
        numbers[APART, m] = 0.0
        numbers[MIXED, m] = here / numbers[TOTAL, m] if numbers[TOTAL, m] > 0.0 else 0.0
    if by_appearance:
        # Persons whom the look would detect count as in the cell, and are detected with certainty.
        for m in range(classes):
            numbers[TAKEN_MIXED, m] = 1.0
        pods_here = numbers[TAKEN_MIXED]
    else:
        pods_here = pods
    if not conclude(constants, pods_here, persons, q >= looks.failed):
        return
    for m in range(classes):
        for k in seen:
            if by_appearance:
                weights[m, k] *= 1.0 - pods[particles.appearances[k] * classes + m]
            else:
                weights[m, k] *= numbers[KEPT_MIXED, m]


@part
def close_weights(mass: Mass, persons: Persons, prior: Floats) -> None:
    """Take over the sums of the classes after looks; an empty class restarts from `prior`."""
    for m in range(len(mass.totals)):
        before, total, weights = mass.totals[m], persons.numbers[TOTAL, m], mass.components[m]
        mass.totals[m] = total
        if total < NOTHING_LEFT * before:
            for k in range(len(prior)):
                weights[k] = prior[k]
            mass.totals[m] = total_of(prior)
        elif not FADED < total < 1.0 / FADED:
            for k in range(len(prior)):
                weights[k] /= total
            mass.totals[m] = total_of(weights)


@kernel
def learn(
    constants: NDArray[np.void],
    particles: BinnedParticles,
    mass: Mass,
    persons: Persons,
    looks: LooksDone,
    pos: float,
) -> float:
    """Update the weights with the looks of a step; return the new POS."""
    if looks.number == 0:
        return pos
    open_classes(persons, mass.totals)
    for q in range(looks.number):
        learn_look(constants[0], particles, mass, persons, looks, q)
    close_weights(mass, persons, particles.prior)
    return mean_found(persons)


@kernel
def write_poc(
    constants: NDArray[np.void],
    particles: BinnedParticles,
    mass: Mass,
    class_of: Ints,
    missing: Floats,
    scale: Floats,
    out: Floats,
) -> None:
    """Write the missing persons' probability of every cell, out (R, C) as [y, x].

    Args:
        scale: (C,) float64 scratch.
        out: Out.
    """
    weigh_classes(class_of, missing, mass.totals, scale)
    for y in range(constants[0].rows):
        for x in range(constants[0].columns):
            here = 0.0
            for k in those_in(particles, index_of(constants[0], x, y)):
                for m in range(len(scale)):
                    here += scale[m] * mass.components[m, k]
            # Rounding may put a sum of shares above 1.
            out[y, x] = min(here, 1.0)


class ParticleTables(NamedTuple):
    """Tables computed once for all missions of a scenario.

    Attributes:
        start: The belief at a mission's first observation.
        particles: By step of the sea.
        pods: (L, C) float64, POD of each look by detection class.
        class_of: (n,) int64, see `search_outcomes`.
        first_step: Steps of the sea before a mission's first observation.
    """

    start: Mass
    particles: BinnedParticles
    pods: NDArray[np.float64]
    class_of: NDArray[np.int64]
    first_step: int


@kernel
def filter_particles(
    done: StepDone,
    tables: ParticleTables,
    beliefs: Beliefs,
    scratch: FilterScratch,
    first: int,
    last: int,
) -> None:
    """Update the beliefs of the worlds first..last - 1 after a step.

    Args:
        tables: Of the scenario.
        beliefs: A `filter_kernels.Beliefs`, in and out.
        scratch: A `filter_kernels.FilterScratch`.
    """
    constants = done.batch.constants
    for b in range(first, last):
        if constants[0].auto_reset and done.over[b]:
            restart(beliefs, tables.start, b)
            continue
        t = done.batch.worlds[b].t - 1
        if not acts_at(constants[0], t):
            continue
        particles = particles_at(tables.particles, tables.first_step + t)
        failed, count = list_looks(done, b, scratch.seen, scratch.rows)
        looks = LooksDone(
            seen=scratch.seen, rows=scratch.rows, pods=tables.pods, failed=failed, number=count
        )
        mass, persons = mass_of(beliefs.masses, b), persons_of(beliefs, tables.class_of, scratch, b)
        beliefs.pos[b] = learn(constants, particles, mass, persons, looks, beliefs.pos[b])


@kernel
def write_particles(
    constants: NDArray[np.void],
    worlds: NDArray[np.void],
    tables: ParticleTables,
    beliefs: Beliefs,
    scale: Floats,
    maps: NDArray[np.float32],
    first: int,
    last: int,
) -> None:
    """Write the probability of every cell of the worlds first..last - 1, (B, R, C) as [y, x].

    `worlds` are (B,) of `entities.WORLDS`; the other arguments are those of `filter_particles` and
    `write_poc`.
    """
    for b in range(first, last):
        particles = particles_at(tables.particles, tables.first_step + worlds[b].t)
        mass, missing = mass_of(beliefs.masses, b), beliefs.missing[b]
        write_poc(constants, particles, mass, tables.class_of, missing, scale, maps[b])


@expanded
def seen_by(particles: BinnedParticles, grid: GridShape, column: int) -> NDArray[np.int32]:
    """Return the particles that a look at a column sees; it sees none off the grid."""
    pitch = grid.columns + 2 * MARGIN
    inside = is_inside(grid, column % pitch - MARGIN, column // pitch - MARGIN)
    return particles.members[particles.starts[column] : particles.starts[column + inside]]


@compiled()
def expect_particles(
    particles: BinnedParticles,
    weights: Floats,
    ends: NDArray[np.integer[Any]],
    left: Floats,
    looks: LooksToCome,
    first: int,
    gamma: float,
    grid: GridShape,
) -> Expected:
    """Return what plans are expected to find, exactly for the particles; see `TargetBelief`.

    Args:
        particles: By step of the sea.
        weights: (C, M) float64, of the missing persons.
        ends: (M,) int32, columns of the particles after the last step.
        left: (S,) float64, the weights there without a look.
        looks: A `LooksToCome` with PODs (Q, A C) by appearance and detection class.
        first: Step of the sea now.
        gamma: Discount per step.
        grid: Its shape.
    """
    plans = len(looks.starts) - 1
    expected = Expected(np.zeros(plans), np.empty((plans, len(left))))
    last = looks.steps.max() if len(looks.steps) else 0
    kept, discounts = weights.copy(), gamma ** np.arange(last + 1)
    for v in range(plans):
        expected.left[v] = left
        of_plan = range(looks.starts[v], looks.starts[v + 1])
        for q in of_plan:
            now, worth = particles_at(particles, first + looks.steps[q]), discounts[looks.steps[q]]
            for k in seen_by(now, grid, looks.columns[q]):
                first_pod = particles.appearances[k] * len(kept)
                for m in range(len(kept)):
                    taken = kept[m, k] * looks.pods[q, first_pod + m]
                    kept[m, k] -= taken
                    expected.left[v, ends[k]] -= taken
                    expected.finds[v] += worth * taken
        for q in of_plan:
            now = particles_at(particles, first + looks.steps[q])
            for k in seen_by(now, grid, looks.columns[q]):
                for m in range(len(kept)):
                    kept[m, k] = weights[m, k]
    return expected

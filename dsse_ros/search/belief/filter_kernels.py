# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled step of many beliefs: update with the searches of each world, then motion.

Arrays are those of `component_kernels` and `search_outcomes`, with a first axis of B worlds.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import inlined, kernel, part
from dsse_ros.search.belief.component_kernels import (
    Mass,
    apply_failed_search,
    close_classes,
    copy_mass,
    detectable,
    mass_of,
)
from dsse_ros.search.belief.component_motion import predict
from dsse_ros.search.belief.look_kernels import LooksDone, StepDone, list_looks
from dsse_ros.search.belief.motion_kernels import (
    Floats,
    Ints,
    MotionTables,
    index_of,
    tables_at,
)
from dsse_ros.search.belief.search_outcomes import (
    Persons,
    learn_outcome,
    mean_found,
    open_classes,
    weigh_classes,
)
from dsse_ros.search.step.constants import Constants
from dsse_ros.search.step.recipe import acts_at
from dsse_ros.world.targets.sea_map import Sea


@kernel
def learn(
    constants: NDArray[np.void],
    mass: Mass,
    moves: MotionTables,
    persons: Persons,
    looks: LooksDone,
    pos: float,
) -> float:
    """Update a belief with the looks of a step; return the new POS."""
    if len(persons.missing) > 1:
        return learn_of_several(constants[0], mass, moves, persons, looks, pos)
    return learn_of_one(constants[0], mass, moves, looks, pos)


@part
def learn_of_several(
    constants: Constants,
    mass: Mass,
    moves: MotionTables,
    persons: Persons,
    looks: LooksDone,
    pos: float,
) -> float:
    """Update the belief about several persons; see `learn`."""
    if looks.number == 0:
        return pos
    open_classes(persons, mass.totals)
    for q in range(looks.number):
        learn_outcome(constants, mass, moves.apart, persons, looks, q)
    close_classes(constants, mass, moves.chances)
    return mean_found(persons)


@part
def learn_of_one(
    constants: Constants, mass: Mass, moves: MotionTables, looks: LooksDone, pos: float
) -> float:
    """Update the belief about a single person; see `learn`."""
    for finds in (False, True):
        first, last = (looks.failed, looks.number) if finds else (0, looks.failed)
        taken = 0.0
        for q in range(first, last):
            x, y, pods = looks.seen[q, 0], looks.seen[q, 1], looks.pods[looks.rows[q]]
            if finds and constants.one_find_per_search:
                share = detectable(constants, mass, pods, x, y)
                pos += (1.0 - pos) * share / mass.totals[0]
            else:
                taken += apply_failed_search(constants, mass, moves.apart, pods, x, y)
        if taken > 0.0:
            pos += (1.0 - pos) * min(taken / mass.totals[0], 1.0)
            close_classes(constants, mass, moves.chances)
    return pos


class Tables(NamedTuple):
    """Tables computed once for all missions of a scenario.

    Attributes:
        start: The belief at a mission's first observation.
        pods: (L, C) float64, POD of each look by detection class.
        class_of: (n,) int64, see `search_outcomes`.
        sea: Of the scenario.
        moves: Those of step s of the sea are at s % R.
        first_step: Steps of the sea before a mission's first observation.
    """

    start: Mass
    pods: NDArray[np.float64]
    class_of: NDArray[np.int64]
    sea: Sea
    moves: MotionTables
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


class FilterScratch(NamedTuple):
    """Memory of a thread.

    Attributes:
        numbers: (`OF_CLASS`, C) float64, see `search_outcomes.Persons`.
        hazard: (n,) float64.
        seen: (Q, 2) int64, see `list_looks`, with room for all looks of a step.
        rows: (Q,) int64, of the same length.
        own: Of the filter: the memory of `predict`, of an ensemble in metres that of
            `passing_kernels.seen_of`.
    """

    numbers: NDArray[np.float64]
    hazard: NDArray[np.float64]
    seen: NDArray[np.int64]
    rows: NDArray[np.int64]
    own: Any


@inlined
def persons_of(beliefs: Beliefs, class_of: Ints, scratch: FilterScratch, b: int) -> Persons:
    """Return what is known of the persons of world b."""
    return Persons(
        class_of=class_of, missing=beliefs.missing[b], unfound=beliefs.unfound[b],
        numbers=scratch.numbers, hazard=scratch.hazard,
    )  # fmt: skip


@part
def restart(beliefs: Beliefs, start: Mass, b: int) -> None:
    """Set the belief of world b, and what is known of its persons, to the start of a mission."""
    copy_mass(start, mass_of(beliefs.masses, b))
    beliefs.missing[b, :] = 1.0
    beliefs.unfound[b, :] = 1.0
    beliefs.pos[b] = 0.0


@kernel
def filter_worlds(
    done: StepDone, tables: Tables, beliefs: Beliefs, scratch: FilterScratch, first: int, last: int
) -> None:
    """Update the beliefs of the worlds first..last - 1 after a step.

    Args:
        tables: Of the scenario.
        beliefs: In and out.
        scratch: Of the thread.
    """
    constants = done.batch.constants
    for b in range(first, last):
        if constants[0].auto_reset and done.over[b]:
            restart(beliefs, tables.start, b)
            continue
        mass = mass_of(beliefs.masses, b)
        t = done.batch.worlds[b].t - 1
        moves = tables_at(tables.moves, (tables.first_step + t) % len(tables.moves.directions))
        if acts_at(constants[0], t):
            failed, count = list_looks(done, b, scratch.seen, scratch.rows)
            looks = LooksDone(
                seen=scratch.seen, rows=scratch.rows, pods=tables.pods, failed=failed, number=count
            )  # fmt: skip
            persons = persons_of(beliefs, tables.class_of, scratch, b)
            beliefs.pos[b] = learn(constants, mass, moves, persons, looks, beliefs.pos[b])
        predict(constants, tables.sea, mass, moves, scratch.own)


@inlined
def add_weighted(sums: Floats, weight: float, cells: Floats) -> None:
    """Add cells to sums, both (C,), with a weight."""
    for x in range(len(sums)):
        sums[x] += weight * cells[x]


@inlined
def write_sums(sums: Floats, weight: float, cells: Floats, out: Floats) -> None:
    """Write what `add_weighted` would add up to."""
    for x in range(len(sums)):
        # Rounding may put a sum of shares below 0 or above 1.
        out[x] = min(max(sums[x] + weight * cells[x], 0.0), 1.0)


@kernel
def write_cells(
    constants: NDArray[np.void],
    mass: Mass,
    class_of: Ints,
    missing: Floats,
    scratch: Floats,
    out: Floats,
) -> None:
    """Write the probability of every cell, out (R, C) as [y, x].

    Args:
        scratch: float64, one for each detection class and each column.
        out: The probabilities of the missing persons.
    """
    weights, sums = scratch[: len(mass.totals)], scratch[len(mass.totals) :]
    weigh_classes(class_of, missing, mass.totals, weights)
    last = len(weights) - 1
    sums[:] = 0.0
    for y in range(len(out)):
        first = index_of(constants[0], 0, y)
        if last > 0:
            sums[:] = 0.0
        for m in range(last):
            add_weighted(sums, weights[m], mass.cells[m, first : first + len(sums)])
        write_sums(sums, weights[last], mass.cells[last, first : first + len(sums)], out[y])


@kernel
def write_beliefs(
    constants: NDArray[np.void],
    beliefs: Beliefs,
    class_of: Ints,
    scratch: Floats,
    maps: NDArray[np.float32],
    first: int,
    last: int,
) -> None:
    """Write the probability of every cell of the worlds first..last - 1, (B, R, C) as [y, x].

    `scratch` is that of `write_cells`.
    """
    for b in range(first, last):
        mass = mass_of(beliefs.masses, b)
        write_cells(constants, mass, class_of, beliefs.missing[b], scratch, maps[b])

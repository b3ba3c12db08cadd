# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled filter of an ensemble in metres: the paths of drones change the weights.

A drone that passes a particle misses a person there with the probability of `sightings.missed`. A
path counts for each person separately, so that a find and a path without one give the same
knowledge of those still missing. Weights are those of `particle_kernels`.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.belief.belief_kernels import Mass, index_of, mass_of
from dsse_ros.belief.follow_kernels import persons_of, restart
from dsse_ros.belief.particle_kernels import BinnedParticles, close_weights, particles_at
from dsse_ros.belief.search_outcomes import (
    APART,
    MIXED,
    TOTAL,
    conclude,
    mean_found,
    open_classes,
)
from dsse_ros.compiled.jit import inlined, kernel, part
from dsse_ros.step.recipe import acts_at
from dsse_ros.step.sightings import FARTHEST_M, ROUNDING_M, middle_and_reach, missed


class Passing(NamedTuple):
    """The paths of the drones of a mission in a step.

    Attributes:
        eyes: (K,) of `sightings.EYES`.
        kinds: (N,) int64, kind of each drone.
        paths: (N, K + 1, 2) float64, metres, see `flight.FlightTask`.
        looked: (N, K + 1) bool, see `sightings.missed`.
        step_s: Time of the step.
        flown: (N,) bool, the drones that were in the search.
        found: (N,) bool, the drones that found somebody.
    """

    eyes: NDArray[np.void]
    kinds: NDArray[np.int64]
    paths: NDArray[np.float64]
    looked: NDArray[np.bool_]
    step_s: float
    flown: NDArray[np.bool_]
    found: NDArray[np.bool_]


class ParticlePositions(NamedTuple):
    """The particles of an ensemble in metres, by step of the sea.

    Attributes:
        particles: By cell, see `BinnedParticles`.
        cell_m: Side of a cell.
        positions: (T, M, 2) float32, metres; after the last step nothing moves.
        moved: (T,) float64, the greatest distance along an axis of a particle in each step.
        multipliers: (C,) float64, multiplier of the POD of each detection class.
    """

    particles: BinnedParticles
    cell_m: float
    positions: NDArray[np.float32]
    moved: NDArray[np.float64]
    multipliers: NDArray[np.float64]


class PassedParticles(NamedTuple):
    """Scratch memory for the particles that a drone passes.

    Attributes:
        numbers: (M,) int32, their numbers.
        missed: (C, M) float64, probability of missing a person of each class there.
        certain: (C,) float64, ones.
        found: (N,) bool, see `Passing`.
    """

    numbers: NDArray[np.int32]
    missed: NDArray[np.float64]
    certain: NDArray[np.float64]
    found: NDArray[np.bool_]


def seen_of(places: ParticlePositions, num_drones: int) -> PassedParticles:
    """Return scratch memory for the particles that N drones pass."""
    particles, classes = places.positions.shape[1], len(places.multipliers)
    return PassedParticles(
        np.empty(particles, np.int32), np.empty((classes, particles)), np.ones(classes),
        np.empty(num_drones, np.bool_),
    )  # fmt: skip


@inlined
def cell_within(constants, places, metres):
    """Return the cell at a coordinate, or the nearest one of the grid."""
    return min(max(int(math.floor(metres / places.cell_m)), 0), constants.grid_size - 1)


@part
def list_passed(constants, places, row, passing, n, seen):
    """Write the particles that drone n passes; return their number.

    They are in the cells around its path.
    """
    path, looked, eye = passing.paths[n], passing.looked[n], passing.eyes[passing.kinds[n]]
    last = len(places.positions) - 1
    before, after = places.positions[row], places.positions[min(row + 1, last)]
    x, wide = middle_and_reach(path, 0, eye.reach + places.moved[row] + ROUNDING_M)
    y, high = middle_and_reach(path, 1, eye.reach + places.moved[row] + ROUNDING_M)
    west = cell_within(constants, places, x - wide)
    east = cell_within(constants, places, x + wide)
    particles, count = particles_at(places.particles, row), 0
    for line in range(
        cell_within(constants, places, y - high), cell_within(constants, places, y + high) + 1
    ):
        first = particles.starts[index_of(constants, west, line)]
        end = particles.starts[index_of(constants, east, line) + 1]
        for i in particles.members[first:end]:
            if abs(before[i, 0] - x) > wide or abs(before[i, 1] - y) > high:
                continue
            place = (before[i, 0], before[i, 1], after[i, 0], after[i, 1])
            sees = False
            for m in range(len(places.multipliers)):
                miss = missed(eye, path, looked, passing.step_s, place, places.multipliers[m])
                seen.missed[m, count] = miss
                sees = sees or miss < 1.0
            if sees:
                seen.numbers[count] = i
                count += 1
    return count


@part
def learn_path(constants, places, row, mass, persons, passing, n, seen):
    """Update the weights with the path of drone n and what it found."""
    count = list_passed(constants, places, row, passing, n, seen)
    numbers, weights = persons.numbers, mass.layers
    for m in range(len(weights)):
        here = 0.0
        for q in range(count):
            here += weights[m, seen.numbers[q]] * (1.0 - seen.missed[m, q])
        numbers[APART, m] = 0.0
        numbers[MIXED, m] = here / numbers[TOTAL, m] if numbers[TOTAL, m] > 0.0 else 0.0
    if not conclude(constants, seen.certain, persons, passing.found[n]):
        return
    if len(persons.missing) == 1:
        # A single person counts as missing until the mission is over.
        persons.missing[0] = 1.0
    for m in range(len(weights)):
        for q in range(count):
            weights[m, seen.numbers[q]] *= seen.missed[m, q]


@kernel
def learn_paths(constants, places, row, mass, persons, passing, seen):
    """Update the weights with the paths of a step; return the new POS.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        places: The particles.
        row: Step of the sea.
        mass: The belief, in and out.
        persons: As in `search_outcomes`, in and out.
        passing: The paths.
        seen: Scratch.
    """
    open_classes(persons, mass.totals)
    for turn in range(2):
        for n in range(len(passing.paths)):
            if passing.flown[n] and passing.found[n] == (turn == 1):
                learn_path(constants[0], places, row, mass, persons, passing, n, seen)
    close_weights(mass, persons, places.particles.prior)
    return mean_found(persons)


class PassingTables(NamedTuple):
    """Tables computed once for all missions of a scenario.

    Attributes:
        start: The belief at a mission's first observation.
        places: The particles.
        class_of: (n,) int64, see `search_outcomes`.
        first_step: Steps of the sea before a mission's first observation.
    """

    start: Mass
    places: ParticlePositions
    class_of: NDArray[np.int64]
    first_step: int


@kernel
def follow_paths(followed, tables, beliefs, scratch, seen, first, last):
    """Update the beliefs of the worlds first..last - 1 after a step.

    Args:
        followed: A `look_kernels.Followed`.
        tables: Of the scenario.
        beliefs: A `follow_kernels.Beliefs`, in and out.
        scratch: A `follow_kernels.FollowScratch`.
        seen: Scratch.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    constants = followed.batch.constants
    flight, crew = followed.batch.task.flight, followed.batch.crew
    for b in range(first, last):
        if constants[0].auto_reset and followed.done[b]:
            restart(beliefs, tables.start, b)
            continue
        t = followed.batch.worlds[b].t - 1
        if not acts_at(constants[0], t):
            continue
        for n in range(len(seen.found)):
            seen.found[n] = crew.drones[b, n].found
        row = min(tables.first_step + t, len(tables.places.positions) - 1)
        passing = Passing(
            flight.eyes, crew.kinds, flight.paths[b], flight.looked[b], flight.wind.step_s,
            followed.live[b], seen.found,
        )  # fmt: skip
        mass, persons = mass_of(beliefs.masses, b), persons_of(beliefs, tables.class_of, scratch, b)
        beliefs.pos[b] = learn_paths(constants, tables.places, row, mass, persons, passing, seen)


def moved_of(positions: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return `ParticlePositions.moved` of positions (T, M, 2), but for particles that vanish."""
    moved = np.zeros(len(positions))
    for step, (before, after) in enumerate(itertools.pairwise(positions)):
        away = np.abs(after - before)
        moved[step] = away[away < FARTHEST_M].max(initial=0.0)
    return moved

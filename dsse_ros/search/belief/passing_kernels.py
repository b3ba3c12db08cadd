# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled filter of an ensemble in metres: the paths of drones change the weights.

A drone that passes a particle misses a person there with the probability of
`metres_detection.missed`. A path counts for each person separately, so that a find and a path
without one give the same knowledge of those still missing. Weights are those of `particle_kernels`.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import inlined, kernel, part
from dsse_ros.search.belief.component_kernels import Mass, mass_of
from dsse_ros.search.belief.filter_kernels import Beliefs, FilterScratch, persons_of, restart
from dsse_ros.search.belief.look_kernels import StepDone
from dsse_ros.search.belief.motion_kernels import index_of
from dsse_ros.search.belief.particle_kernels import BinnedParticles, close_weights, particles_at
from dsse_ros.search.belief.search_outcomes import (
    APART,
    MIXED,
    TOTAL,
    Persons,
    conclude,
    mean_found,
    open_classes,
)
from dsse_ros.search.step.constants import Constants
from dsse_ros.search.step.metres_detection import (
    FARTHEST_M,
    ROUNDING_M,
    farthest_reach,
    middle_and_reach,
    missed,
)
from dsse_ros.search.step.recipe import acts_at


class Passing(NamedTuple):
    """The paths of the drones of a mission in a step.

    Attributes:
        detectors: (K, A) of `metres_detection.DETECTORS`, by kind and appearance.
        kinds: (N,) int64, kind of each drone.
        paths: (N, K + 1, 2) float64, metres, see `metres_kernels.MetresArrays`.
        looked: (N, K + 1) bool, see `metres_detection.missed`.
        step_s: Time of the step.
        flown: (N,) bool, the drones that were in the search.
        found: (N,) bool, the drones that found somebody.
    """

    detectors: NDArray[np.void]
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
        numbers=np.empty(particles, np.int32), missed=np.empty((classes, particles)),
        certain=np.ones(classes), found=np.empty(num_drones, np.bool_),
    )  # fmt: skip


@inlined
def cell_within(size: int, places: ParticlePositions, metres: float) -> int:
    """Return the column or row at a coordinate, or the nearest of the `size` of the grid."""
    return min(max(int(math.floor(metres / places.cell_m)), 0), size - 1)


@part
def list_passed(
    constants: Constants,
    places: ParticlePositions,
    row: int,
    passing: Passing,
    n: int,
    seen: PassedParticles,
) -> int:
    """Write the particles that drone n passes; return their number.

    They are in the cells around its path.
    """
    path, looked, detectors = (
        passing.paths[n],
        passing.looked[n],
        passing.detectors[passing.kinds[n]],
    )
    reach = farthest_reach(detectors)
    last = len(places.positions) - 1
    before, after = places.positions[row], places.positions[min(row + 1, last)]
    x, wide = middle_and_reach(path, 0, reach + places.moved[row] + ROUNDING_M)
    y, high = middle_and_reach(path, 1, reach + places.moved[row] + ROUNDING_M)
    west = cell_within(constants.columns, places, x - wide)
    east = cell_within(constants.columns, places, x + wide)
    particles, count = particles_at(places.particles, row), 0
    north = cell_within(constants.rows, places, y - high)
    south = cell_within(constants.rows, places, y + high)
    for line in range(north, south + 1):
        first = particles.starts[index_of(constants, west, line)]
        end = particles.starts[index_of(constants, east, line) + 1]
        for i in particles.members[first:end]:
            if abs(before[i, 0] - x) > wide or abs(before[i, 1] - y) > high:
                continue
            place = (before[i, 0], before[i, 1], after[i, 0], after[i, 1])
            detector = detectors[particles.appearances[i]]
            sees = False
            for m in range(len(places.multipliers)):
                miss = missed(detector, path, looked, passing.step_s, place, places.multipliers[m])
                seen.missed[m, count] = miss
                sees = sees or miss < 1.0
            if sees:
                seen.numbers[count] = i
                count += 1
    return count


@kernel
def write_missed(
    constants: NDArray[np.void],
    places: ParticlePositions,
    row: int,
    passing: Passing,
    n: int,
    seen: PassedParticles,
    out: NDArray[np.float64],
) -> None:
    """Write the probability that drone n misses a person of the first class, (M,) by particle."""
    out[:] = 1.0
    for q in range(list_passed(constants[0], places, row, passing, n, seen)):
        out[seen.numbers[q]] = seen.missed[0, q]


@kernel
def multiply_missed(
    detector: NDArray[np.void],
    points: NDArray[np.float64],
    steps: NDArray[np.float64],
    places: ParticlePositions,
    area: NDArray[np.bool_],
    step_s: float,
    looked: NDArray[np.bool_],
    out: NDArray[np.float64],
) -> None:
    """Multiply the probabilities that persons are missed by those of a flight.

    Between two points the drone and the particles move straight.

    Args:
        detector: (1,) of `metres_detection.DETECTORS`, its own.
        points: (K, 2) float64, where it is, metres; it looks from the first one to the last, but
            not where it stays.
        steps: (K,) float64, when it is there, in steps of the sea.
        places: The particles.
        area: (R, C) bool, the searched cells.
        step_s: Time of a step.
        looked: (2,) bool, scratch; the first one is whether it looked right before the first point.
        out: (C, M) float64 by class, in and out.
    """
    positions, last = places.positions, len(places.positions) - 1
    looked[1] = True
    for k in range(len(points) - 1):
        looked[0] = looked[0] or k > 0
        path, time_s = points[k : k + 2], (steps[k + 1] - steps[k]) * step_s
        if path[0, 0] == path[1, 0] and path[0, 1] == path[1, 1]:
            continue
        first, second = min(int(steps[k]), last), min(int(steps[k + 1]), last)
        of_first, of_second = steps[k] - int(steps[k]), steps[k + 1] - int(steps[k + 1])
        from_first, to_first = positions[first], positions[min(first + 1, last)]
        from_second, to_second = positions[second], positions[min(second + 1, last)]
        x, wide = middle_and_reach(path, 0, detector[0].reach + ROUNDING_M)
        y, high = middle_and_reach(path, 1, detector[0].reach + ROUNDING_M)
        for i in range(positions.shape[1]):
            x0 = from_first[i, 0] + of_first * (to_first[i, 0] - from_first[i, 0])
            x1 = from_second[i, 0] + of_second * (to_second[i, 0] - from_second[i, 0])
            if min(x0, x1) > x + wide or max(x0, x1) < x - wide:
                continue
            y0 = from_first[i, 1] + of_first * (to_first[i, 1] - from_first[i, 1])
            y1 = from_second[i, 1] + of_second * (to_second[i, 1] - from_second[i, 1])
            if min(y0, y1) > y + high or max(y0, y1) < y - high:
                continue
            col, row = math.floor(x0 / places.cell_m), math.floor(y0 / places.cell_m)
            if not (0 <= col < area.shape[1] and 0 <= row < len(area)) or not area[row, col]:
                continue
            for m in range(len(out)):
                out[m, i] *= missed(
                    detector[0], path, looked, time_s, (x0, y0, x1, y1), places.multipliers[m]
                )


@part
def learn_path(
    constants: Constants,
    places: ParticlePositions,
    row: int,
    mass: Mass,
    persons: Persons,
    passing: Passing,
    n: int,
    seen: PassedParticles,
) -> None:
    """Update the weights with the path of drone n and what it found."""
    count = list_passed(constants, places, row, passing, n, seen)
    numbers, weights = persons.numbers, mass.components
    for m in range(len(weights)):
        here = 0.0
        for q in range(count):
            here += weights[m, seen.numbers[q]] * (1.0 - seen.missed[m, q])
        numbers[APART, m] = 0.0
        numbers[MIXED, m] = here / numbers[TOTAL, m] if numbers[TOTAL, m] > 0.0 else 0.0
    if not conclude(constants, seen.certain, persons, passing.found[n]):
        return
    for m in range(len(weights)):
        for q in range(count):
            weights[m, seen.numbers[q]] *= seen.missed[m, q]


@kernel
def learn_paths(
    constants: NDArray[np.void],
    places: ParticlePositions,
    row: int,
    mass: Mass,
    persons: Persons,
    passing: Passing,
    seen: PassedParticles,
) -> float:
    """Update the weights with the paths of a step; return the new POS.

    Args:
        row: Step of the sea.
    """
    open_classes(persons, mass.totals)
    for finds in (False, True):
        for n in range(len(passing.paths)):
            if passing.flown[n] and passing.found[n] == finds:
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
def filter_paths(
    done: StepDone,
    tables: PassingTables,
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
    metres, entities, seen = done.batch.extensions.metres, done.batch.entities, scratch.own
    for b in range(first, last):
        if constants[0].auto_reset and done.over[b]:
            restart(beliefs, tables.start, b)
            continue
        t = done.batch.worlds[b].t - 1
        if not acts_at(constants[0], t):
            continue
        for n in range(len(seen.found)):
            seen.found[n] = entities.drones[b, n].found
        row = min(tables.first_step + t, len(tables.places.positions) - 1)
        passing = Passing(
            detectors=metres.detectors, kinds=entities.kinds, paths=metres.paths[b],
            looked=metres.looked[b], step_s=metres.wind.step_s, flown=done.live[b],
            found=seen.found,
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

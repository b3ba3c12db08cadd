# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The effect of a search's outcome with several persons, compiled: who is missing, and where.

A drone learns whether its search found someone, not whom. Persons with the same start and POD are
one detection class: its missing persons have the same distribution. Persons move independently.

A search for all persons in its cell looks for each person separately: a find and a failed search
give the same knowledge of those still missing. A search for one person finds the first one in the
cell by number: after a find there may be others, for whom it did not look. Persons scattered over
different cells are apart until their first step: no two of them share a cell.

After each search persons count as independent of each other again. This is exact unless the search
looked for one person where several may have been; see docs/belief.md.

Each search has a hazard for each person: the probability of finding them, given the finds of others
so far. The product of one minus the hazards is the probability that missions with the same searches
have not found the person. Its mean over the persons is one minus the POS.

Arguments with the same names mean the same everywhere, with n persons in C classes: `constants` is
an element of `constants.CONSTANTS`, `one_find` whether a search looks for the first person in its
cell only, `pods` (C,) float64 the probability of detection by class, `persons` a `Persons`, `found`
whether the search found somebody, `total` how probable a find was.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import kernel, part
from dsse_ros.search.belief.component_kernels import Mass, place_of, remove
from dsse_ros.search.belief.look_kernels import LooksDone
from dsse_ros.search.belief.motion_kernels import MARGIN, Flags, Floats, Ints
from dsse_ros.search.step.constants import Constants
from dsse_ros.world.targets.sea_map import is_inside

TOTAL, APART, MIXED, LEFT_APART, LEFT_MIXED, TAKEN_APART, TAKEN_MIXED, ELSEWHERE = range(8)
"""Numbers of a class: the sum of its belief; the probability that a missing person of the class is
in the searched cell, apart from all others or not; the factors of the outcome on these two,
relative to the probability that the person is elsewhere, and one minus them; the probability of the
outcome if the person is elsewhere."""
OF_CLASS = 8

SURE = 1e-9
"""A probability closer to 0 or 1 than this counts as certain."""


class Persons(NamedTuple):
    """What is known of the persons of a mission.

    Attributes:
        class_of: (n,) int64, the detection class of each person.
        missing: (n,) float64, probability that each person is missing.
        unfound: (n,) float64, the same, regardless of the outcomes of the searches.
        numbers: (`OF_CLASS`, C) float64 scratch, the numbers of the classes.
        hazard: (n,) float64 scratch, probability that a search detects each person if it is
            missing.
    """

    class_of: NDArray[np.int64]
    missing: NDArray[np.float64]
    unfound: NDArray[np.float64]
    numbers: NDArray[np.float64]
    hazard: NDArray[np.float64]


@part
def hazards(one_find: bool, pods: Floats, persons: Persons) -> float:
    """Write the hazards of a search; return the probability that it finds anyone."""
    class_of, missing = persons.class_of, persons.missing
    numbers, hazard = persons.numbers, persons.hazard
    total, nobody, none, occupied = 0.0, 1.0, 1.0, 0.0
    for p in range(len(missing)):
        m = class_of[p]
        alone, mixed = numbers[APART, m], numbers[MIXED, m]
        looked_for = alone + mixed
        if one_find:
            looked_for = none * (alone + mixed * (1.0 - occupied))
        none *= 1.0 - missing[p] * mixed
        occupied = min(occupied + missing[p] * alone, 1.0)
        hazard[p] = looked_for * pods[m]
        total += missing[p] * hazard[p]
        nobody *= 1.0 - missing[p] * hazard[p]
    return min(total, 1.0) if one_find else 1.0 - nobody


@part
def what_is_left(one_find: bool, pods: Floats, persons: Persons, found: bool, total: float) -> None:
    """Write `LEFT_APART` and `LEFT_MIXED`: the remaining shares of the classes in the cell."""
    numbers = persons.numbers
    for m in range(len(pods)):
        numbers[LEFT_APART, m] = numbers[LEFT_MIXED, m] = 0.0 if one_find else 1.0 - pods[m]
        numbers[ELSEWHERE, m] = 0.0
    if not one_find:
        return
    add_what_is_left(pods, persons, found, total)
    for m in range(len(pods)):
        if numbers[ELSEWHERE, m] > 0.0:
            numbers[LEFT_APART, m] /= numbers[ELSEWHERE, m]
            numbers[LEFT_MIXED, m] /= numbers[ELSEWHERE, m]
        else:
            # All persons of the class are found: write where one would be if it were missing.
            numbers[LEFT_APART, m] = numbers[LEFT_MIXED, m] = 1.0 - pods[m]


@part
def add_what_is_left(pods: Floats, persons: Persons, found: bool, total: float) -> None:
    """Add up `LEFT_APART`, `LEFT_MIXED` and `ELSEWHERE` of a search for the first person."""
    class_of, missing = persons.class_of, persons.missing
    numbers, hazard = persons.numbers, persons.hazard
    # Probabilities that persons before this one leave it to be looked for, or are detected.
    none, occupied, before, before_mixed = 1.0, 0.0, 0.0, 0.0
    for p in range(len(missing)):
        m, share = class_of[p], missing[p]
        mixed = share * numbers[MIXED, m]
        alone = min(share * numbers[APART, m], 1.0 - occupied)
        detected, after = share * hazard[p], 0.0
        if alone + mixed < 1.0 - SURE:
            after = max(total - before - detected, 0.0) / (1.0 - alone - mixed)
        if found:
            # The find is another person.
            numbers[LEFT_APART, m] += share * before_mixed
            numbers[LEFT_MIXED, m] += share * before
            numbers[ELSEWHERE, m] += share * (before + after)
        else:
            # Rounding may leave each of these below 0.
            own = none * pods[m]
            numbers[LEFT_APART, m] += share * max(1.0 - before_mixed - own, 0.0)
            numbers[LEFT_MIXED, m] += share * max(1.0 - before - own * (1.0 - occupied), 0.0)
            numbers[ELSEWHERE, m] += share * max(1.0 - before - after, 0.0)
        before += detected
        before_mixed += none * mixed * pods[m]
        none *= 1.0 - mixed
        occupied += alone


@part
def update_missing(one_find: bool, persons: Persons, found: bool, total: float) -> None:
    """Update the probabilities of being missing with the outcome of a search.

    A find reduces the expected number of missing persons by the expected number of finds, which is
    one in a search for one person. At least one stays missing, because the search continues. A
    failed search keeps their number, but persons whom it would have detected are less likely to be
    missing. With two persons this is exact.
    """
    missing, hazard = persons.missing, persons.hazard
    count, expected = 0.0, 0.0
    for p in range(len(missing)):
        detected = missing[p] * hazard[p]
        count += missing[p]
        expected += detected
        if found:
            # The find is another person; in a search for all, this one is not detected.
            others = total - detected
            if not one_find:
                others = (1.0 - hazard[p]) * max(
                    1.0 - (1.0 - total) / max(1.0 - detected, SURE), 0.0
                )
            missing[p] *= others / total
            if missing[p] < SURE:
                missing[p] = 0.0
    if found:
        count = max(count - expected / total, 1.0)
    in_question = 0
    for p in range(len(missing)):
        if SURE < missing[p] < 1.0 - SURE:
            in_question += 1
        else:
            count -= missing[p]
    few_missing, total_weight = 2.0 * count <= in_question, 0.0
    for turn in range(2):
        for p in range(len(missing)):
            if SURE < missing[p] < 1.0 - SURE:
                left = 1.0 if found else max(1.0 - hazard[p], SURE)
                weight = missing[p] * left if few_missing else (1.0 - missing[p]) / left
                if turn == 0:
                    total_weight += weight
                elif few_missing:
                    missing[p] = min(weight * max(count, 0.0) / total_weight, 1.0)
                else:
                    missing[p] = 1.0 - min(
                        weight * max(in_question - count, 0.0) / total_weight, 1.0
                    )


@kernel
def weigh_classes(class_of: Ints, missing: Floats, totals: Floats, weights: Floats) -> None:
    """Write the factors, (C,), that make a belief that of the missing persons, with the sum 1.

    `totals` are those of the `Mass`. A class counts by its share of the missing persons.
    """
    count = 0.0
    for p in range(len(missing)):
        count += missing[p]
    weights[:] = 0.0
    for p in range(len(missing)):
        share = missing[p] / count if count > SURE else 1.0 / len(missing)
        weights[class_of[p]] += share
    for m in range(len(weights)):
        weights[m] = weights[m] / totals[m] if totals[m] > 0.0 else 0.0


@part
def open_classes(persons: Persons, totals: Floats) -> None:
    """Write the sum of each class of a belief."""
    for m in range(len(totals)):
        persons.numbers[TOTAL, m] = totals[m]


@part
def conclude(constants: Constants, pods: Floats, persons: Persons, found: bool) -> bool:
    """Compute the effect of a search's outcome; return whether it has any.

    Of `persons.numbers`, `TOTAL`, `APART` and `MIXED` are in, and `TOTAL`, `LEFT_APART` and
    `LEFT_MIXED` are out, the factors for the classes in the cell.
    """
    one_find, numbers = constants.one_find_per_search, persons.numbers
    total = hazards(one_find, pods, persons)
    for p in range(len(persons.unfound)):
        persons.unfound[p] *= 1.0 - persons.hazard[p]
    if found and total <= 0.0:
        return False
    what_is_left(one_find, pods, persons, found, total)
    # A single person counts as missing until the mission is over.
    if len(persons.missing) > 1 and not (found and constants.found_persons_stay):
        update_missing(one_find, persons, found, total)
    for m in range(len(pods)):
        alone, mixed = numbers[LEFT_APART, m], numbers[LEFT_MIXED, m]
        numbers[TOTAL, m] *= (
            1.0 + numbers[APART, m] * (alone - 1.0) + numbers[MIXED, m] * (mixed - 1.0)
        )
    return True


@part
def learn_outcome(
    constants: Constants, mass: Mass, apart: Flags, persons: Persons, looks: LooksDone, q: int
) -> None:
    """Update the belief about several persons with the outcome of look q.

    Call it for all looks of a step between `open_classes` and `close_classes`. A look off the grid
    has no effect.

    Args:
        apart: (K,) of `MotionTables`.
    """
    x, y, pods = looks.seen[q, 0], looks.seen[q, 1], looks.pods[looks.rows[q]]
    if not is_inside(constants.grid_size, x, y):
        return
    numbers, drifts = persons.numbers, len(apart)
    for m in range(len(pods)):
        alone = mixed = 0.0
        for k in range(drifts):
            at = place_of(mass, m * drifts + k, x + MARGIN, y + MARGIN)
            if at >= 0 and apart[k]:
                alone += mass.components[m * drifts + k, at]
            elif at >= 0:
                mixed += mass.components[m * drifts + k, at]
        scale = 1.0 / numbers[TOTAL, m] if numbers[TOTAL, m] > 0.0 else 0.0
        numbers[APART, m], numbers[MIXED, m] = alone * scale, mixed * scale
    if conclude(constants, pods, persons, q >= looks.failed):
        for m in range(len(pods)):
            numbers[TAKEN_APART, m] = 1.0 - numbers[LEFT_APART, m]
            numbers[TAKEN_MIXED, m] = 1.0 - numbers[LEFT_MIXED, m]
        remove(constants, mass, apart, numbers[TAKEN_APART], numbers[TAKEN_MIXED], x, y)


@part
def mean_found(persons: Persons) -> float:
    """Return the POS: the expected share of the persons that the searches have found."""
    unfound = persons.unfound
    total = 0.0
    for p in range(len(unfound)):
        total += 1.0 - unfound[p]
    return total / len(unfound)

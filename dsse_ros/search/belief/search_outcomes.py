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
from dsse_ros.world.targets.sea_map import grid_of, is_inside

TOTAL, APART, MIXED, KEPT_APART, KEPT_MIXED, TAKEN_APART, TAKEN_MIXED, ELSEWHERE = range(8)
"""Numbers of a class:

- `TOTAL`: the sum of its belief.
- `APART`, `MIXED`: the probabilities that a missing person of the class is in the searched cell,
  apart from all others or not.
- `KEPT_APART`, `KEPT_MIXED`: the factors of the outcome on these two, relative to the probability
  that the person is elsewhere. `TAKEN_APART`, `TAKEN_MIXED`: one minus them.
- `ELSEWHERE`: the probability of the outcome if the person is elsewhere.
"""
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
def open_classes(persons: Persons, totals: Floats) -> None:
    """Write the sum of each class of a belief."""
    for m in range(len(totals)):
        persons.numbers[TOTAL, m] = totals[m]


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
    if not is_inside(grid_of(constants), x, y):
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
            numbers[TAKEN_APART, m] = 1.0 - numbers[KEPT_APART, m]
            numbers[TAKEN_MIXED, m] = 1.0 - numbers[KEPT_MIXED, m]
        remove(constants, mass, apart, numbers[TAKEN_APART], numbers[TAKEN_MIXED], x, y)


@part
def conclude(constants: Constants, pods: Floats, persons: Persons, found: bool) -> bool:
    """Compute the effect of a search's outcome; return whether it has any.

    Of `persons.numbers`, `TOTAL`, `APART` and `MIXED` are in, and `TOTAL`, `KEPT_APART` and
    `KEPT_MIXED` are out.
    """
    one_find = constants.one_find_per_search
    total = hazards_of_first(pods, persons) if one_find else hazards_of_all(pods, persons)
    for p in range(len(persons.unfound)):
        persons.unfound[p] *= 1.0 - persons.hazard[p]
    if found and total <= 0.0:
        return False
    if one_find:
        keep_by_first(pods, persons, found, total)
    else:
        keep_by_all(pods, persons)
    # A single person counts as missing until the mission is over.
    if len(persons.missing) > 1 and not (found and constants.found_persons_stay):
        update_missing(one_find, persons, found, total)
    scale_totals(persons)
    return True


@part
def hazards_of_all(pods: Floats, persons: Persons) -> float:
    """Write the hazards of a search for all persons; return the probability that it finds anyone.

    A person's hazard is the probability that it is in the cell, times the POD.
    """
    class_of, missing = persons.class_of, persons.missing
    numbers, hazard = persons.numbers, persons.hazard
    nobody = 1.0
    for p in range(len(missing)):
        m = class_of[p]
        hazard[p] = (numbers[APART, m] + numbers[MIXED, m]) * pods[m]
        nobody *= 1.0 - missing[p] * hazard[p]
    return 1.0 - nobody


@part
def hazards_of_first(pods: Floats, persons: Persons) -> float:
    """Write the hazards of a search for the first person; return the probability of a find.

    A person's hazard is the probability that it is in the cell and none with a smaller number is,
    times the POD. Those who are apart are in the cell one at a time; the others independently.
    """
    class_of, missing = persons.class_of, persons.missing
    numbers, hazard = persons.numbers, persons.hazard
    # Probabilities that no earlier mixed person is in the cell, and that an earlier apart one is.
    total, no_mixed, occupied = 0.0, 1.0, 0.0
    for p in range(len(missing)):
        m = class_of[p]
        alone, mixed = numbers[APART, m], numbers[MIXED, m]
        looked_for = no_mixed * (alone + mixed * (1.0 - occupied))
        no_mixed *= 1.0 - missing[p] * mixed
        occupied = min(occupied + missing[p] * alone, 1.0)
        hazard[p] = looked_for * pods[m]
        total += missing[p] * hazard[p]
    return min(total, 1.0)


@part
def keep_by_all(pods: Floats, persons: Persons) -> None:
    """Write the kept shares after a search for all persons: one minus the POD, find or not."""
    numbers = persons.numbers
    for m in range(len(pods)):
        numbers[KEPT_APART, m] = numbers[KEPT_MIXED, m] = 1.0 - pods[m]


@part
def keep_by_first(pods: Floats, persons: Persons, found: bool, total: float) -> None:
    """Write the kept shares after a search for the first person.

    By Bayes' rule they are the probabilities of the outcome if a missing person of the class is in
    the cell, over that if the person is elsewhere. For a class they are sums over its persons.
    """
    numbers = persons.numbers
    for m in range(len(pods)):
        numbers[KEPT_APART, m] = numbers[KEPT_MIXED, m] = numbers[ELSEWHERE, m] = 0.0
    add_chances_of_outcome(pods, persons, found, total)
    for m in range(len(pods)):
        if numbers[ELSEWHERE, m] > 0.0:
            numbers[KEPT_APART, m] /= numbers[ELSEWHERE, m]
            numbers[KEPT_MIXED, m] /= numbers[ELSEWHERE, m]
        else:
            # All persons of the class are found: write where one would be if it were missing.
            numbers[KEPT_APART, m] = numbers[KEPT_MIXED, m] = 1.0 - pods[m]


@part
def add_chances_of_outcome(pods: Floats, persons: Persons, found: bool, total: float) -> None:
    """Add up the probabilities of the outcome if each person is in the cell or elsewhere.

    A find is somebody before this person, who is then not looked for, or somebody after it.
    """
    class_of, missing = persons.class_of, persons.missing
    numbers, hazard = persons.numbers, persons.hazard
    # Of the persons before this one: the probabilities that no mixed one is in the cell, that one
    # who is apart is, that one is detected, and that one is detected who is mixed.
    no_mixed, occupied, before, before_mixed = 1.0, 0.0, 0.0, 0.0
    for p in range(len(missing)):
        m, share = class_of[p], missing[p]
        mixed = share * numbers[MIXED, m]
        alone = min(share * numbers[APART, m], 1.0 - occupied)
        detected, after = share * hazard[p], 0.0
        if alone + mixed < 1.0 - SURE:
            after = max(total - before - detected, 0.0) / (1.0 - alone - mixed)
        if found:
            # The find is another person.
            numbers[KEPT_APART, m] += share * before_mixed
            numbers[KEPT_MIXED, m] += share * before
            numbers[ELSEWHERE, m] += share * (before + after)
        else:
            # Rounding may leave each of these below 0.
            own = no_mixed * pods[m]
            numbers[KEPT_APART, m] += share * max(1.0 - before_mixed - own, 0.0)
            numbers[KEPT_MIXED, m] += share * max(1.0 - before - own * (1.0 - occupied), 0.0)
            numbers[ELSEWHERE, m] += share * max(1.0 - before - after, 0.0)
        before += detected
        before_mixed += no_mixed * mixed * pods[m]
        no_mixed *= 1.0 - mixed
        occupied += alone


@part
def scale_totals(persons: Persons) -> None:
    """Change the sum of each class by what the outcome keeps of it in the cell."""
    numbers = persons.numbers
    for m in range(numbers.shape[1]):
        alone, mixed = numbers[KEPT_APART, m], numbers[KEPT_MIXED, m]
        numbers[TOTAL, m] *= (
            1.0 + numbers[APART, m] * (alone - 1.0) + numbers[MIXED, m] * (mixed - 1.0)
        )


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
            missing[p] *= chance_of_other(one_find, detected, hazard[p], total) / total
            if missing[p] < SURE:
                missing[p] = 0.0
    if found:
        count = max(count - expected / total, 1.0)
    rescale_missing(persons, found, count)


@part
def chance_of_other(one_find: bool, detected: float, hazard: float, total: float) -> float:
    """Return the probability that a search finds somebody and that a missing person stays missing.

    Args:
        detected: The probability that the search detects the person.
        hazard: The same if the person is missing.
        total: The probability of a find.
    """
    if one_find:
        return total - detected
    # The find is another person, and this one is not detected.
    return (1.0 - hazard) * max(1.0 - (1.0 - total) / max(1.0 - detected, SURE), 0.0)


@part
def rescale_missing(persons: Persons, found: bool, count: float) -> None:
    """Make the probabilities of being missing sum to `count`, without those that are certain.

    After a failed search each also falls with the person's hazard. They are in proportion to
    their own weights if few persons are missing, else those of being found are: neither exceeds 1.
    """
    missing, hazard = persons.missing, persons.hazard
    in_question = 0
    for p in range(len(missing)):
        if SURE < missing[p] < 1.0 - SURE:
            in_question += 1
        else:
            count -= missing[p]
    few_missing, total_weight = 2.0 * count <= in_question, 0.0
    for p in range(len(missing)):
        if SURE < missing[p] < 1.0 - SURE:
            total_weight += weight_of(missing[p], hazard[p], found, few_missing)
    for p in range(len(missing)):
        if SURE < missing[p] < 1.0 - SURE:
            weight = weight_of(missing[p], hazard[p], found, few_missing)
            if few_missing:
                missing[p] = min(weight * max(count, 0.0) / total_weight, 1.0)
            else:
                missing[p] = 1.0 - min(weight * max(in_question - count, 0.0) / total_weight, 1.0)


@part
def weight_of(missing: float, hazard: float, found: bool, few_missing: bool) -> float:
    """Return the weight of a person in `rescale_missing`: of being missing, or of being found."""
    undetected = 1.0 if found else max(1.0 - hazard, SURE)
    return missing * undetected if few_missing else (1.0 - missing) / undetected


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
def mean_found(persons: Persons) -> float:
    """Return the POS: the expected share of the persons that the searches have found."""
    unfound = persons.unfound
    total = 0.0
    for p in range(len(unfound)):
        total += 1.0 - unfound[p]
    return total / len(unfound)

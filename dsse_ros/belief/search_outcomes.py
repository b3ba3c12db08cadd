# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""What the outcome of a search means for several persons, compiled: who is missing, and where.

A drone learns whether its search has found someone, not whom. Persons who start alike and have the
same POD are one detection class: its persons who are missing are as probable in each cell. Persons
move independently.

Where a search looks for all in its cell, it looks for each person alone: after a find and after a
failed search the same is known of those who are still missing. Where it looks for one, that is the
first in the cell by number: after a find others may be there, who were not looked for. Persons who
were scattered over different cells are apart until their first step: no two of them are in one
cell.

After each search persons count as independent of each other again, which is exact unless the search
looked for one where several may have been. docs/ros.md says what is exact and what the tests hold.

Of the searches that were done, each person has its own hazards, as the finds of others leave them.
The product of one minus these is the probability that missions with the same searches have not
found it; its mean over the persons is one minus the POS.

Arguments with the same names mean the same everywhere, with n persons in C classes:

    one_find: Whether a search looks for the first person in its cell only.
    pods: (C,) float64, probability of detection.
    class_of: (n,) int64, the class of each person.
    missing: (n,) float64, probability that each person is missing.
    hazard: (n,) float64, probability that a search detects each person if it is missing.
    numbers: (`OF_CLASS`, C) float64 of the classes.
"""

from __future__ import annotations

from dsse_ros.belief.belief_kernels import NOTHING_LEFT, index_of, total_of
from dsse_ros.compiled.jit import kernel, part

TOTAL, APART, MIXED, LEFT_APART, LEFT_MIXED, ELSEWHERE = range(6)
"""Numbers of a class: what its belief sums to; the probability that a missing person of it is in
the searched cell, apart from all others or not; by how much the outcome changes these two, relative
to the probability that the person is elsewhere; how probable the outcome is if it is there."""
OF_CLASS = 6

SURE = 1e-9
"""A probability closer to 0 or 1 is not in question."""


@part
def hazards(one_find, pods, class_of, missing, numbers, hazard):
    """Write the hazards of a search; returns the probability that it finds anyone."""
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
def what_is_left(one_find, pods, class_of, missing, hazard, found, total, numbers):
    """Write `LEFT_APART` and `LEFT_MIXED`: what a search leaves of the classes in its cell.

    Args:
        one_find: As in the module.
        pods: As in the module.
        class_of: As in the module.
        missing: As in the module.
        hazard: As in the module.
        found: Whether the search has found anyone.
        total: How probable that was.
        numbers: As in the module, in and out.
    """
    for m in range(len(pods)):
        numbers[LEFT_APART, m] = numbers[LEFT_MIXED, m] = 0.0 if one_find else 1.0 - pods[m]
        numbers[ELSEWHERE, m] = 0.0
    if not one_find:
        return
    # Whom the persons before this one leave to be looked for, and what is detected of those.
    none, occupied, before, before_mixed = 1.0, 0.0, 0.0, 0.0
    for p in range(len(missing)):
        m, share = class_of[p], missing[p]
        mixed = share * numbers[MIXED, m]
        alone = min(share * numbers[APART, m], 1.0 - occupied)
        detected, after = share * hazard[p], 0.0
        if alone + mixed < 1.0 - SURE:
            after = max(total - before - detected, 0.0) / (1.0 - alone - mixed)
        if found:
            # Another person is found.
            numbers[LEFT_APART, m] += share * before_mixed
            numbers[LEFT_MIXED, m] += share * before
            numbers[ELSEWHERE, m] += share * (before + after)
        else:
            own = none * pods[m]
            numbers[LEFT_APART, m] += share * (1.0 - before_mixed - own)
            numbers[LEFT_MIXED, m] += share * (1.0 - before - own * (1.0 - occupied))
            numbers[ELSEWHERE, m] += share * max(1.0 - before - after, 0.0)
        before += detected
        before_mixed += none * mixed * pods[m]
        none *= 1.0 - mixed
        occupied += alone
    for m in range(len(pods)):
        if numbers[ELSEWHERE, m] > 0.0:
            numbers[LEFT_APART, m] /= numbers[ELSEWHERE, m]
            numbers[LEFT_MIXED, m] /= numbers[ELSEWHERE, m]
        else:
            # All its persons are found: where one would be if it were not.
            numbers[LEFT_APART, m] = numbers[LEFT_MIXED, m] = 1.0 - pods[m]


@part
def update_missing(one_find, missing, hazard, found, total):
    """Update who is missing by the outcome of a search.

    After a find as many are missing as before, less those that it was expected to find: one, where
    it looks for one. It is one at least, as the search goes on. After a failed search it is as many
    as before, and those less probably whom it would have detected. With two persons this is exact.

    Args:
        one_find: As in the module.
        missing: As in the module, in and out.
        hazard: As in the module.
        found: Whether the search has found anyone.
        total: How probable that was.
    """
    count, expected = 0.0, 0.0
    for p in range(len(missing)):
        detected = missing[p] * hazard[p]
        count += missing[p]
        expected += detected
        if found:
            # Another person is found, and where it looks for all, this one is not.
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
    few_missing, whole = 2.0 * count <= in_question, 0.0
    for turn in range(2):
        for p in range(len(missing)):
            if SURE < missing[p] < 1.0 - SURE:
                left = 1.0 if found else max(1.0 - hazard[p], SURE)
                weight = missing[p] * left if few_missing else (1.0 - missing[p]) / left
                if turn == 0:
                    whole += weight
                elif few_missing:
                    missing[p] = min(weight * max(count, 0.0) / whole, 1.0)
                else:
                    missing[p] = 1.0 - min(weight * max(in_question - count, 0.0) / whole, 1.0)


@kernel
def weigh_classes(class_of, missing, weights):
    """Write how much more of the missing persons are of each class than of all persons, (C,)."""
    count = 0.0
    for p in range(len(missing)):
        count += missing[p]
    weights[:] = 1.0
    if len(weights) == 1 or count <= SURE:
        return
    for m in range(len(weights)):
        persons, here = 0, 0.0
        for p in range(len(missing)):
            if class_of[p] == m:
                persons += 1
                here += missing[p]
        weights[m] = here / count * len(missing) / persons


@part
def open_classes(class_of, numbers):
    """Write what each class of a belief sums to: its share of all persons."""
    numbers[TOTAL, :] = 0.0
    for p in range(len(class_of)):
        numbers[TOTAL, class_of[p]] += 1.0 / len(class_of)


@part
def conclude(c, pods, class_of, missing, unfound, numbers, hazard, found):
    """Draw what follows from the outcome of a search; returns whether anything does.

    Args:
        c: The constants.
        pods: See `search_outcomes`, as all that follow.
        class_of: (n,) int64.
        missing: (n,) float64, in and out.
        unfound: (n,) float64, in and out.
        numbers: (`OF_CLASS`, C) float64: `TOTAL`, `APART` and `MIXED` in, `TOTAL`, `LEFT_APART` and
            `LEFT_MIXED` out, by which the classes are to be multiplied in the cell.
        hazard: (n,) float64 scratch.
        found: Whether the search has found somebody.
    """
    total = hazards(c.one_find_per_search, pods, class_of, missing, numbers, hazard)
    for p in range(len(unfound)):
        unfound[p] *= 1.0 - hazard[p]
    if found and total <= 0.0:
        return False
    what_is_left(c.one_find_per_search, pods, class_of, missing, hazard, found, total, numbers)
    if not (found and c.found_persons_stay):
        update_missing(c.one_find_per_search, missing, hazard, found, total)
    for m in range(len(pods)):
        alone, mixed = numbers[LEFT_APART, m], numbers[LEFT_MIXED, m]
        numbers[TOTAL, m] *= (
            1.0 + numbers[APART, m] * (alone - 1.0) + numbers[MIXED, m] * (mixed - 1.0)
        )
    return True


@part
def learn_outcome(
    c, belief, pods, class_of, missing, unfound, apart, numbers, hazard, x, y, found
):  # fmt: skip
    """Let the belief of several persons learn how the search of a cell has ended.

    It stands between `open_classes` and `close_classes`, with others of the same step.

    Args:
        c: The constants.
        belief: (C K, S S) float64.
        pods: See `search_outcomes`, as all that follow.
        class_of: (n,) int64.
        missing: (n,) float64.
        unfound: (n,) float64.
        apart: (K,) of `forecast_step`.
        numbers: (`OF_CLASS`, C) float64.
        hazard: (n,) float64 scratch.
        x: Column of the cell; off the grid nobody is looked for.
        y: Row of the cell.
        found: Whether the search has found somebody.
    """
    if not (0 <= x < c.grid_size and 0 <= y < c.grid_size):
        return
    i, drifts = index_of(c, x, y), len(belief) // len(pods)
    for m in range(len(pods)):
        alone = mixed = 0.0
        for k in range(drifts):
            if apart[k]:
                alone += belief[m * drifts + k, i]
            else:
                mixed += belief[m * drifts + k, i]
        scale = 1.0 / numbers[TOTAL, m] if numbers[TOTAL, m] > 0.0 else 0.0
        numbers[APART, m], numbers[MIXED, m] = alone * scale, mixed * scale
    if not conclude(c, pods, class_of, missing, unfound, numbers, hazard, found):
        return
    for m in range(len(pods)):
        alone, mixed = numbers[LEFT_APART, m], numbers[LEFT_MIXED, m]
        for k in range(drifts):
            belief[m * drifts + k, i] *= alone if apart[k] else mixed


@part
def close_classes(belief, class_of, missing, numbers, chances):
    """Scale each class of a belief to its share of all persons.

    Where nothing is left of a class, as its persons cannot be anywhere by the rules, it starts
    again from the present map.
    """
    classes = numbers.shape[1]
    drifts = len(belief) // classes
    open_classes(class_of, numbers)
    for m in range(classes):
        share, total = numbers[TOTAL, m], 0.0
        rows = belief[m * drifts : (m + 1) * drifts]
        for k in range(drifts):
            total += total_of(rows[k])
        if total < NOTHING_LEFT * share:
            for k in range(drifts):
                for i in range(len(chances)):
                    rows[k, i] = chances[i]
            total = drifts * total_of(chances)
        scale = share / total
        for k in range(drifts):
            for i in range(len(chances)):
                rows[k, i] *= scale


@part
def mean_found(unfound):
    """Return the POS: the expected share of the persons that the searches have found."""
    total = 0.0
    for p in range(len(unfound)):
        total += 1.0 - unfound[p]
    return total / len(unfound)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled looks of a drone: their finds and rewards.

Arguments are as in `kernels`; `first` and `last` are numbers of the looks of an action, see
`looks.Looks`.
"""

from __future__ import annotations

import numpy as np

from dsse_ros.compiled.draws import draw_unit
from dsse_ros.compiled.jit import inlined
from dsse_ros.step.ensemble_kernels import probability_in
from dsse_ros.targets.sea_map import cell_probability, is_open


@inlined
def probability_of(c, w, gauss, area, ensemble, x, y):
    """Return the probability of the cell (x, y), 0 outside the grid and the area."""
    if ensemble is not None:
        return probability_in(c, w, ensemble, x, y)
    return cell_probability(c, w, gauss, area, x, y)


@inlined
def look(c, w, d, persons, area, offsets, pods, first, last):
    """Do the looks first..last - 1 of a drone from its cell.

    A look off the grid or outside the area finds nobody. After the end of a mission of v1 it does:
    its drones fly on off the grid, and search there.

    Returns:
        Number of persons found, and a bit for each look that found any.
    """
    finds, bits, bit = 0, np.uint64(0), np.uint64(1)
    for k in range(first, last):
        x, y = d.x + offsets[k, 0], d.y + offsets[k, 1]
        for p in range(len(persons)):
            person = persons[p]
            gone = person.found and not c.found_persons_stay
            if gone or person.x != x or person.y != y:
                continue
            if not is_open(area, c.grid_size, x, y) and not w.done:
                break
            chance = pods[k, p]
            if chance >= 1.0 or draw_unit(w) < chance:
                person.found = True
                finds += 1
                bits |= bit
            if c.one_find_per_search:
                break
        bit <<= np.uint64(1)
    return finds, bits


@inlined
def reward_find(c, w, finds):
    """Return the reward for finding this many persons."""
    return finds * (c.find + c.find_bonus * (1.0 - w.t / c.timestep_limit))


@inlined
def reward_search(c, w, gauss, area, ensemble, d, offsets, first, last):
    """Return the reward of a search that found nobody, by the probability of its cells."""
    probability = 0.0
    for k in range(first, last):
        x, y = d.x + offsets[k, 0], d.y + offsets[k, 1]
        if c.leave_flies_on:
            # For a drone outside to the west or north, a negative index selects the cell.
            x, y = (x + c.grid_size if x < 0 else x), (y + c.grid_size if y < 0 else y)
        probability += probability_of(c, w, gauss, area, ensemble, x, y)
    enough = probability > c.search_min_probability or (
        c.search_min_inclusive and probability == c.search_min_probability
    )
    return probability * c.search_scale if enough else c.search_below

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The scenarios that the plans of the other drones leave to a drone, and their worth to it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.compiled.jit import compiled, inlined
from dsse_ros.planners.plan_kernels import UNIT, seen_from


class Left(NamedTuple):
    """The scenarios that the plans of the other drones leave, by their places: cells at the end.

    Attributes:
        free: (M / 64,) uint64, a bit for each scenario that they do not find.
        base: (M,) int64 in `UNIT`, credit of the others' plans for each scenario.
        places: (M,) int64, place of each scenario; E if no free one ends there.
        counts: (E + 1,) int64, number of free scenarios in each place.
        positions: (E + 1,) int64, positions of the places, see `Moves`.
        worths: (S S,) int64 in `UNIT`, their worth seen from a cell; -1 until it is computed.
    """

    free: NDArray[np.uint64]
    base: NDArray[np.int64]
    places: NDArray[np.int64]
    counts: NDArray[np.int64]
    positions: NDArray[np.int64]
    worths: NDArray[np.int64]


@compiled()
def left_by_others(moves, scenarios, others):
    """Return the scenarios that the plans of the others leave.

    Args:
        moves: Of the drone's kind.
        scenarios: The scenarios.
        others: (N, M) float64, credits of their plans, 0 for the drone itself.
    """
    credit = np.zeros(len(scenarios.ends))
    for n in range(len(others)):
        for s in range(len(credit)):
            if others[n, s] > credit[s]:
                credit[s] = others[n, s]
    counts = np.zeros(len(moves.positions), np.int64)
    for s in range(len(credit)):
        counts[scenarios.ends[s]] += credit[s] == 0.0
    cells = np.flatnonzero(counts)
    last = len(cells)
    numbers = np.full(len(counts), last)
    for place in range(last):
        numbers[cells[place]] = place
    free = np.zeros((len(credit) + 63) >> 6, np.uint64)
    base = np.empty(len(credit), np.int64)
    for s in range(len(credit)):
        free[s >> 6] |= np.uint64(credit[s] == 0.0) << np.uint64(s & 63)
        base[s] = int(credit[s] * UNIT)
    left, positions = np.zeros(last + 1, np.int64), np.zeros(last + 1, np.int64)
    left[:last], positions[:last] = counts[cells], moves.positions[cells]
    return Left(free, base, numbers[scenarios.ends], left, positions, np.full(len(counts), -1))


@inlined
def worth_of(moves, left, counts, cell):
    """Return the worth to a drone in a cell of as many scenarios at the end in each place."""
    total, here = 0, moves.positions[cell]
    for place in range(len(counts)):
        total += counts[place] * seen_from(moves, here, left.positions[place])
    return total


@inlined
def worth_from(moves, left, cell):
    """Return the worth of the scenarios left at the end to a drone in a cell."""
    if left.worths[cell] < 0:
        left.worths[cell] = worth_of(moves, left, left.counts, cell)
    return left.worths[cell]

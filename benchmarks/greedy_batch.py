# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The greedy policy that the authors of DSSE published in 2024, for B worlds at once.

Of the N most probable cells in ascending order the i-th belongs to drone i, who moves towards
it, diagonally while both axes differ, and searches when there. A drone whose next cell is that of
another drone searches where it is; drones before it stand where they have just chosen to go.

The map is symmetric about its datum, so that many cells have exactly the same probability, and
which of them count as the most probable is up to the order in which a sort leaves equal values.
The published code calls `numpy.argsort`, whose default is not stable, and its figures depend on
it: see `TIES`.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dsse_ros.world.scenario.actions import ACTION_VECTORS

TIES = ("quicksort", "stable")
"""`quicksort`: the order of NumPy's quicksort without vector instructions.
`stable`: of equal values, the later one in the map counts as the greater."""

SMALL = 15
"""NumPy uses insertion sort for parts of at most this length plus one."""


@njit(cache=True, nogil=True)
def quicksort_tail(values, order, count):
    """Put the indices of the `count` greatest values last in `order`, in ascending order.

    They are those at the end of `numpy.argsort(values)` by NumPy's scalar quicksort, equal values
    in the same order: median of three, the pivot kept beside the end, insertion sort at last. Parts
    of the array that cannot reach its tail are left as they are, and so is the fall-back to another
    sort, which takes an adversary.

    Args:
        values: (M,) floats without NaN.
        order: (M,) int64 out.
        count: At most M.
    """
    for i in range(len(values)):
        order[i] = i
    first = len(values) - count
    # Parts still to be sorted, which do not overlap.
    pending = np.empty((64, 2), np.int64)
    pending[0] = 0, len(values) - 1
    parts = 1
    while parts > 0:
        parts -= 1
        low, high = pending[parts]
        while high - low > SMALL:
            middle = low + ((high - low) >> 1)
            if values[order[middle]] < values[order[low]]:
                order[middle], order[low] = order[low], order[middle]
            if values[order[high]] < values[order[middle]]:
                order[high], order[middle] = order[middle], order[high]
            if values[order[middle]] < values[order[low]]:
                order[middle], order[low] = order[low], order[middle]
            pivot = values[order[middle]]
            i, j = low, high - 1
            order[middle], order[j] = order[j], order[middle]
            while True:
                i += 1
                while values[order[i]] < pivot:
                    i += 1
                j -= 1
                while pivot < values[order[j]]:
                    j -= 1
                if i >= j:
                    break
                order[i], order[j] = order[j], order[i]
            order[i], order[high - 1] = order[high - 1], order[i]
            if i > first:
                pending[parts] = low, i - 1
                parts += 1
            low = i + 1
        for i in range(low + 1, high + 1):
            index = order[i]
            value = values[index]
            j = i
            while j > low and value < values[order[j - 1]]:
                order[j] = order[j - 1]
                j -= 1
            order[j] = index


@njit(cache=True, nogil=True)
def stable_tail(values, order, count):
    """Put the indices of the `count` greatest values last in `order`, as a stable sort does."""
    first = len(values) - count
    for i in range(len(values)):
        k = min(i, count)
        if k == count and values[i] < values[order[first]]:
            continue
        # Free the place of the least, or the next one to the left of those there are.
        place = first if k == count else len(values) - 1 - k
        while place + 1 < len(values) and values[i] >= values[order[place + 1]]:
            order[place] = order[place + 1]
            place += 1
        order[place] = i


@njit(cache=True, nogil=True)
def choose(maps, drones, which, quicksort, numbers, actions):
    """Write the joint actions of the worlds with which[b].

    Args:
        maps: (B, G, G) float32, [y, x].
        drones: (B, N) with fields x and y.
        which: (B,) bool.
        quicksort: Whether ties come as NumPy's quicksort leaves them, or as a stable sort does.
        numbers: (3, 3) int8, the action that moves by (dx, dy) at [dy + 1, dx + 1].
        actions: (B, N) int8 out.
    """
    g, count = maps.shape[1], drones.shape[1]
    order = np.empty(g * g, np.int64)
    x, y = np.empty(count, np.int64), np.empty(count, np.int64)
    for b in range(len(maps)):
        if not which[b]:
            continue
        values = maps[b].reshape(g * g)
        if quicksort:
            quicksort_tail(values, order, count)
        else:
            stable_tail(values, order, count)
        for n in range(count):
            x[n], y[n] = drones[b, n].x, drones[b, n].y
        for n in range(count):
            goal = order[g * g - count + n]
            dx, dy = np.sign(goal % g - x[n]), np.sign(goal // g - y[n])
            for m in range(count):
                if m != n and x[m] == x[n] + dx and y[m] == y[n] + dy:
                    dx = dy = 0
                    break
            x[n], y[n] = x[n] + dx, y[n] + dy
            actions[b, n] = numbers[dy + 1, dx + 1]


class GreedyBatch:
    """The greedy policy.

    Args:
        actions: Names of the actions by number, with diagonals.
        ties: One of `TIES`.
    """

    def __init__(self, actions: tuple[str, ...], ties: str) -> None:
        self._numbers = np.zeros((3, 3), np.int8)
        for number, name in enumerate(actions):
            dx, dy = ACTION_VECTORS[name]
            self._numbers[dy + 1, dx + 1] = number
        self._quicksort = {"quicksort": True, "stable": False}[ties]

    def __call__(
        self, maps: NDArray[np.float32], drones: NDArray[np.void], which: NDArray[np.bool_]
    ) -> NDArray[np.int8]:
        """Return joint actions (B, N); those of worlds without which[b] do not count."""
        actions = np.zeros(drones.shape, np.int8)
        choose(maps, drones, which, self._quicksort, self._numbers, actions)
        return actions

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled parts of a path search: passes over a Markov chain, and the best path of a searcher.

Arguments with the same names mean the same everywhere:

    chain: The persons' motion, `TargetChain`, for H looks: one in each layer but the last.
    graph: The moves and looks of a kind of searcher on the columns of the chain, see
        `problem.SearchGraph`.
    gains: (H,) float64, value of a first detection in each step; never increasing.
    worth: float64, value of each state of the last layer if the person is undetected.
    miss: (N,) float64, probability that the planned looks of a step miss a person in each state.
    later: (N,) float64 of `backward`.
    reach: (N,) float64 of `forward`.
    task: A `PathTask`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import compiled, inlined, kernel, part


class PathTask(NamedTuple):
    """What the path of a searcher adds to: the plans of the others.

    Attributes:
        chain: As in the module.
        graph: Of the searcher.
        gains: As in the module.
        ends: (C,) float64, value of ending in each column.
        miss: Of the other searchers.
        later: With the looks of the other searchers.
        blocked: (H, C) bool, columns that the searcher must not be in after step h.
        weights: (H, C) float64, factors on what a look in a column adds; (0, 0) for none, as
            factors make no bounds.
    """

    chain: Any
    graph: Any
    gains: NDArray[np.float64]
    ends: NDArray[np.float64]
    miss: NDArray[np.float64]
    later: NDArray[np.float64]
    blocked: NDArray[np.bool_]
    weights: NDArray[np.float64]


@kernel
def forward(chain, miss, reach):
    """Write the probability that the person reaches each state undetected."""
    reach[:] = 0.0
    for s in range(len(chain.prior)):
        reach[s] = chain.prior[s]
    spread(chain, miss, reach, 0)


@part
def spread(chain, miss, reach, h):
    """Complete `reach` from its layer h to the end; later layers must be 0."""
    for s in range(chain.starts[h, 0], chain.starts[-1, 0]):
        left = reach[s] * miss[s]
        if left > 0.0:
            for e in range(chain.first[s], chain.first[s + 1]):
                reach[chain.to[e]] += left * chain.chance[e]


@kernel
def backward(chain, gains, worth, miss, later):
    """Write the expected value of what follows the looks at each state, if they all miss."""
    steps, last = len(gains), chain.starts[-1, 0]
    for k in range(len(worth)):
        later[last + k] = worth[k]
    for h in range(steps - 1, -1, -1):
        for s in range(chain.starts[h, 0], chain.starts[h + 1, 0]):
            total = 0.0
            for e in range(chain.first[s], chain.first[s + 1]):
                n = chain.to[e]
                after = worth[n - last] if h == steps - 1 else 0.0
                if h < steps - 1:
                    after = (1.0 - miss[n]) * gains[h + 1] + miss[n] * later[n]
                total += chain.chance[e] * after
            later[s] = total


@kernel
def value_of(chain, gains, worth, miss, reach):
    """Return the expected value of plans, after `forward`."""
    total = 0.0
    for h in range(len(gains)):
        for s in range(chain.starts[h, 0], chain.starts[h + 1, 0]):
            total += reach[s] * (1.0 - miss[s]) * gains[h]
    last = chain.starts[-1, 0]
    for k in range(len(worth)):
        total += reach[last + k] * worth[k]
    return total


@part
def multiply_misses_of_looks(chain, graph, h, a, cell, values):
    """Multiply `values` of the states of a layer by the probabilities that a move's looks miss.

    Args:
        chain: As in the module.
        graph: As in the module.
        h: The step.
        a: The move.
        cell: The searcher's column after it.
        values: (N,) float64 in and out, only layer h is touched.
    """
    for k in range(graph.looks[a], graph.looks[a + 1]):
        there = graph.there[k, cell]
        if there >= 0:
            for s in range(chain.starts[h, there], chain.starts[h, there + 1]):
                values[s] *= 1.0 - graph.pods[k, chain.persons[s]]


@kernel
def multiply_miss(chain, graph, start, moves, miss):
    """Multiply `miss` by the probabilities that the looks of these moves (H,) miss."""
    cell = start
    for h in range(len(moves)):
        cell = graph.ahead[moves[h], cell]
        multiply_misses_of_looks(chain, graph, h, moves[h], cell, miss)


@inlined
def gain_of(task, reach, h, a, cell):
    """Return what the looks of move a add to a plan if the searcher looks no more later.

    Args:
        task: As in the module.
        reach: As in the module, only layer h is read.
        h: The step.
        a: The move.
        cell: The searcher's column after it.
    """
    chain, graph, gain = task.chain, task.graph, task.gains[h]
    total = 0.0
    for k in range(graph.looks[a], graph.looks[a + 1]):
        there = graph.there[k, cell]
        if there >= 0:
            for s in range(chain.starts[h, there], chain.starts[h, there + 1]):
                pod = graph.pods[k, chain.persons[s]]
                total += reach[s] * task.miss[s] * pod * (gain - task.later[s])
    return total


@compiled()
def columns_of(ahead, start, moves):
    """Return the columns after each of these moves (H,)."""
    columns, cell = np.empty(len(moves), np.int64), start
    for h in range(len(moves)):
        cell = ahead[moves[h], cell]
        columns[h] = cell
    return columns


@compiled()
def reachable(ahead, start, steps):
    """Return the columns that a searcher can be in after this number of steps."""
    now = np.zeros(ahead.shape[1], np.bool_)
    now[start] = True
    for _ in range(steps):
        after = np.zeros_like(now)
        for cell in np.flatnonzero(now):
            for a in range(len(ahead)):
                if ahead[a, cell] >= 0:
                    after[ahead[a, cell]] = True
        now = after
    return np.flatnonzero(now)


@kernel
def worth_of_ends(left, worth, nearness, columns, ends):
    """Write what one more searcher that ends in these columns adds to the worth.

    Args:
        left: (C,) float64, the probability that the person is in a column and undetected.
        worth: (C,) float64, the worth of a person in each column without the searcher.
        nearness: (S, S) float64, see `problem.PathProblem`.
        columns: (E,) int64.
        ends: (C,) float64 in and out.
    """
    side = len(nearness)
    for i in range(len(left)):
        if left[i] == 0.0:
            continue
        y, x = i // side, i % side
        for j in columns:
            near = nearness[abs(j // side - y), abs(j % side - x)]
            ends[j] += left[i] * max(near - worth[i], 0.0)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled search for the best path of a searcher, by branch and bound.

Arguments with the same names mean the same as in `kernels`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.paths.kernels import gain_of, multiply_misses_of_looks, spread
from dsse_ros.base.compiled.jit import compiled, inlined, part


class PathOptions(NamedTuple):
    """What is asked of a path.

    Attributes:
        width: Paths kept at each step.
        threshold: Only paths that add more than this count.
        revisits: Whether a path may be in a cell twice, including its start.
        first_moves: Its first moves, int64, at most H.
    """

    width: int
    threshold: float
    revisits: bool
    first_moves: NDArray[np.int64]


class Bounds(NamedTuple):
    """Memory of the bounds on what the looks of the steps from h0 on add.

    Attributes:
        reach: (N,) float64; layer h0 is in.
        cone: (H + 1, C) int64, the columns in which the searcher can be.
        counts: (H + 1,) int64, their number.
        marks: (C,) bool, False before and after each use.
        own: (Q, C) float64, what a look adds alone.
        best: (H, Q, C) float64, the bounds, by step, looks of the previous move and column before
            the step.
    """

    reach: NDArray[np.float64]
    cone: NDArray[np.int64]
    counts: NDArray[np.int64]
    marks: NDArray[np.bool_]
    own: NDArray[np.float64]
    best: NDArray[np.float64]


class Paths(NamedTuple):
    """The kept paths, W at each step.

    Attributes:
        cells: (H + 1, W) int64.
        parents: (H + 1, W) int64, number of the path at the step before.
        moves: (H + 1, W) int64, the last move.
    """

    cells: NDArray[np.int64]
    parents: NDArray[np.int64]
    moves: NDArray[np.int64]


class PathLevel(NamedTuple):
    """The kept paths to one step.

    Attributes:
        reach: (W, states of a layer) float64, the part of `reach` that each path's looks leave.
        added: (W,) float64, what each path adds.
    """

    reach: NDArray[np.float64]
    added: NDArray[np.float64]


class Tried(NamedTuple):
    """Moves from the kept paths.

    Attributes:
        paths: (W A,) int64.
        moves: (W A,) int64.
        added: (W A,) float64, what the longer path adds.
        bounds: (W A,) float64, a bound on what it can add, weighted.
    """

    paths: NDArray[np.int64]
    moves: NDArray[np.int64]
    added: NDArray[np.float64]
    bounds: NDArray[np.float64]


@inlined
def counted_twice(task, reach, h, a, cell, before, cell_before):
    """Return the part of `gain_of` of persons whom the searcher's previous looks detect.

    Args:
        task: This and the following arguments are those of `gain_of`.
        reach: As there, layer h - 1 is read.
        h: As there.
        a: As there.
        cell: As there.
        before: A move with the looks of the previous step.
        cell_before: The column after it.
    """
    chain, graph = task.chain, task.graph
    total = 0.0
    for k in range(graph.looks[a], graph.looks[a + 1]):
        there = graph.there[k, cell]
        if there < 0:
            continue
        low, high = chain.starts[h, there], chain.starts[h, there + 1]
        for j in range(graph.looks[before], graph.looks[before + 1]):
            from_cell = graph.there[j, cell_before]
            if from_cell < 0:
                continue
            for s in range(chain.starts[h - 1, from_cell], chain.starts[h - 1, from_cell + 1]):
                here = reach[s] * task.miss[s] * graph.pods[j, chain.persons[s]]
                if here > 0.0:
                    total = add_steps(task, total, here, h, s, k, low, high)
    return total


@inlined
def add_steps(task, total, here, h, s, k, low, high):
    """Add to a sum what look k of step h adds of persons who come from state s.

    Args:
        task: As in the module.
        total: The sum.
        here: Probability that a person is in state s, and detected there.
        h: The step.
        s: A state of the layer before.
        k: The look.
        low: First state that the look sees.
        high: Last state that it sees, plus one.
    """
    chain, graph = task.chain, task.graph
    for e in range(chain.first[s], chain.first[s + 1]):
        n = chain.to[e]
        if low <= n < high:
            pod = graph.pods[k, chain.persons[n]]
            gain = task.gains[h] - task.later[n]
            total += here * chain.chance[e] * task.miss[n] * pod * gain
    return total


@part
def bound_rest(task, bounds, h0, start):
    """Write bounds on what a searcher's looks from step h0 on add to the other searchers' plans.

    The sum of what each look adds alone counts persons whom several looks detect more than once;
    this leaves out persons whom the look before detects (the bounds MEAN, Martins 1993, and DMEAN,
    Lau et al. 2008). The best path by this sum follows by dynamic programming.

    Args:
        task: As in the module.
        bounds: In and out.
        h0: First step.
        start: The searcher's column before it.
    """
    bounds.reach[task.chain.starts[h0 + 1, 0] :] = 0.0
    spread(task.chain, task.miss, bounds.reach, h0)
    open_cone(task, bounds, h0, start)
    for h in range(len(task.gains) - 1, h0 - 1, -1):
        for i in range(bounds.counts[h + 1]):
            cell = bounds.cone[h + 1, i]
            for q in range(len(task.graph.examples)):
                a = task.graph.examples[q]
                bounds.own[q, cell] = gain_of(task, bounds.reach, h, a, cell)
        for i in range(bounds.counts[h]):
            bound_cell(task, bounds, h0, h, bounds.cone[h, i])


@inlined
def open_cone(task, bounds, h0, start):
    """Write the columns in which the searcher can be after each step from h0 on."""
    cone, counts, marks = bounds.cone, bounds.counts, bounds.marks
    cone[h0, 0], counts[h0] = start, 1
    for h in range(h0, len(task.gains)):
        count = 0
        for i in range(counts[h]):
            for a in range(len(task.graph.ahead)):
                cell = task.graph.ahead[a, cone[h, i]]
                if cell >= 0 and not task.blocked[h, cell] and not marks[cell]:
                    marks[cell] = True
                    cone[h + 1, count] = cell
                    count += 1
        counts[h + 1] = count
        for i in range(count):
            marks[cone[h + 1, i]] = False


@inlined
def bound_cell(task, bounds, h0, h, cell):
    """Write the bounds on what the looks from step h on add, from a column before the step."""
    graph, best, last = task.graph, bounds.best, len(task.gains) - 1
    best[h, :, cell] = -np.inf
    for a in range(len(graph.ahead)):
        after = graph.ahead[a, cell]
        if after < 0 or task.blocked[h, after]:
            continue
        gain = bounds.own[graph.alike[a], after]
        weight = task.weights[h, after] if len(task.weights) else 1.0
        rest = best[h + 1, graph.alike[a], after] if h < last else task.ends[after]
        for q in range(len(graph.examples)):
            twice = 0.0
            if h > h0 and gain > 0.0:
                twice = counted_twice(task, bounds.reach, h, a, after, graph.examples[q], cell)
            best[h, q, cell] = max(best[h, q, cell], weight * (gain - twice) + rest)


@part
def was_there(cells, parents, h, node, cell):
    """Return whether the path to a node of step h has been in a cell."""
    while True:
        if cells[h, node] == cell:
            return True
        if h == 0:
            return False
        node = parents[h, node]
        h -= 1


@compiled()
def best_path(task, options, start):
    """Find the path of a searcher that adds most to the plans of the others.

    It branches by step and keeps the paths with the greatest bounds. If it never has more than
    `width` of them, the path is optimal.

    Args:
        task: As in the module.
        options: What is asked of the path.
        start: The searcher's column.

    Returns:
        What the path adds, -inf if none adds more than `threshold`; a bound on what any path adds;
        the moves of the path, (H,) int64.
    """
    steps, width, dropped = len(task.gains), options.width, options.threshold
    most = (task.chain.starts[:, -1] - task.chain.starts[:, 0]).max()
    bounds, paths, tried = new_bounds(task), new_paths(steps, width), new_tried(task, width)
    now, after = new_level(width, most), new_level(width, most)
    now.reach[0, : len(task.chain.prior)] = task.chain.prior
    paths.cells[0, 0] = start
    moves, nodes = np.zeros(steps, np.int64), 1
    for h in range(steps):
        found = extend(task, options, paths, now, bounds, tried, h, nodes)
        if found == 0:
            return -np.inf, dropped, moves
        order = np.argsort(-tried.bounds[:found])
        if found > width:
            dropped = max(dropped, tried.bounds[order[width]])
        nodes = min(found, width)
        keep(task, paths, now, after, tried, order[:nodes], bounds.reach, h)
        now, after = after, now
    node = int(np.argmax(now.added[:nodes]))
    total = now.added[node]
    for h in range(steps, 0, -1):
        moves[h - 1] = paths.moves[h, node]
        node = paths.parents[h, node]
    return total, max(dropped, total), moves


@compiled()
def new_bounds(task):
    """Return memory for bounds."""
    steps, columns, looks = len(task.gains), task.graph.ahead.shape[1], len(task.graph.examples)
    return Bounds(
        np.zeros(task.chain.starts[-1, -1]),
        np.empty((steps + 1, columns), np.int64),
        np.empty(steps + 1, np.int64),
        np.zeros(columns, np.bool_),
        np.empty((looks, columns)),
        np.empty((steps, looks, columns)),
    )


@compiled()
def new_paths(steps, width):
    """Return memory for W paths."""
    cells, parents, moves = np.empty((3, steps + 1, width), np.int64)
    return Paths(cells, parents, moves)


@compiled()
def new_level(width, most):
    """Return memory for W paths to a step."""
    return PathLevel(np.zeros((width, most)), np.zeros(width))


@compiled()
def new_tried(task, width):
    """Return memory for the moves from W paths."""
    count = width * len(task.graph.ahead)
    return Tried(
        np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count), np.empty(count)
    )


@part
def extend(task, options, paths, level, bounds, tried, h, nodes):
    """Write the moves from the paths to step h to `tried`, and return their number."""
    low, fixed, found = task.chain.starts[h, 0], len(options.first_moves), 0
    size = task.chain.starts[h, -1] - low
    for node in range(nodes):
        for s in range(size):
            bounds.reach[low + s] = level.reach[node, s]
        if h >= fixed:
            bound_rest(task, bounds, h, paths.cells[h, node])
        for a in range(len(task.graph.ahead)):
            cell = cell_after(task, options, paths, h, node, a)
            if cell < 0:
                continue
            gain = gain_of(task, bounds.reach, h, a, cell)
            total = level.added[node] + gain
            rest = 0.0
            if h == len(task.gains) - 1:
                total += task.ends[cell]
            elif h >= fixed:
                rest = bounds.best[h + 1, task.graph.alike[a], cell]
            if h >= fixed and total + rest <= options.threshold:
                continue
            weighted = gain * (task.weights[h, cell] - 1.0) if len(task.weights) else 0.0
            tried.paths[found], tried.moves[found] = node, a
            tried.added[found], tried.bounds[found] = total, total + rest + weighted
            found += 1
    return found


@inlined
def cell_after(task, options, paths, h, node, a):
    """Return the column after move a from a path, -1 if the path must not make it."""
    if h < len(options.first_moves) and a != options.first_moves[h]:
        return -1
    cell = task.graph.ahead[a, paths.cells[h, node]]
    if cell < 0 or task.blocked[h, cell]:
        return -1
    if not options.revisits and was_there(paths.cells, paths.parents, h, node, cell):
        return -1
    return cell


@part
def keep(task, paths, level, after, tried, order, reach, h):
    """Make the moves of this order the paths to the next step; `reach` is scratch."""
    chain, graph = task.chain, task.graph
    low, high = chain.starts[h, 0], chain.starts[h, -1]
    for k in range(len(order)):
        node, a = tried.paths[order[k]], tried.moves[order[k]]
        cell = graph.ahead[a, paths.cells[h, node]]
        paths.cells[h + 1, k], paths.moves[h + 1, k], paths.parents[h + 1, k] = cell, a, node
        after.added[k] = tried.added[order[k]]
        if h == len(task.gains) - 1:
            continue
        for s in range(low, high):
            reach[s] = level.reach[node, s - low] * task.miss[s]
        multiply_misses_of_looks(chain, graph, h, a, cell, reach)
        after.reach[k, : chain.starts[h + 1, -1] - high] = 0.0
        for s in range(low, high):
            if reach[s] > 0.0:
                for e in range(chain.first[s], chain.first[s + 1]):
                    after.reach[k, chain.to[e] - high] += reach[s] * chain.chance[e]

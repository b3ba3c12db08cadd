# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled parts of a path search: passes over a Markov chain, and the best path of a searcher.

Arguments with the same names mean the same everywhere:

    chain: The persons' motion, `TargetChain`, for H looks: one in each layer but the last.
    graph: The moves and looks of a kind of searcher on the columns of the chain, see
        `path_problem.SearchGraph`.
    gains: (H,) float64, value of a first detection in each step; never increasing.
    worth: float64, value of each state of the last layer if the person is undetected.
    miss: (N,) float64, probability that the planned looks of a step miss a person in each state.
    later: (N,) float64 of `backward`.
    reach: (N,) float64 of `forward`.
    blocked: (H, C) bool, columns that the searcher must not be in after step h.
"""

from __future__ import annotations

import numpy as np

from dsse_ros.compiled.jit import compiled


@compiled()
def forward(chain, miss, reach):
    """Write the probability that the person reaches each state undetected."""
    reach[:] = 0.0
    reach[: len(chain.prior)] = chain.prior
    spread(chain, miss, reach, 0)


@compiled()
def spread(chain, miss, reach, h):
    """Complete `reach` from its layer h to the end; later layers must be 0."""
    for s in range(chain.starts[h, 0], chain.starts[-1, 0]):
        left = reach[s] * miss[s]
        if left > 0.0:
            for e in range(chain.first[s], chain.first[s + 1]):
                reach[chain.to[e]] += left * chain.chance[e]


@compiled()
def backward(chain, gains, worth, miss, later):
    """Write the expected value of what follows the looks at each state, if they all miss."""
    steps, last = len(gains), chain.starts[-1, 0]
    later[last:] = worth
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


@compiled()
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


@compiled()
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
    for k in range(graph.first[a], graph.first[a + 1]):
        there = graph.there[k, cell]
        if there >= 0:
            for s in range(chain.starts[h, there], chain.starts[h, there + 1]):
                values[s] *= 1.0 - graph.pods[k, chain.persons[s]]


@compiled()
def multiply_miss(chain, graph, start, moves, miss):
    """Multiply `miss` by the probabilities that the looks of these moves (H,) miss."""
    cell = start
    for h in range(len(moves)):
        cell = graph.ahead[moves[h], cell]
        multiply_misses_of_looks(chain, graph, h, moves[h], cell, miss)


@compiled()
def gain_of(chain, graph, gain, miss, later, reach, h, a, cell):
    """Return what the looks of move a add to a plan if the searcher looks no more later.

    Args:
        chain: As in the module.
        graph: As in the module.
        gain: Value of a detection in this step.
        miss: Of the other searchers.
        later: As in the module.
        reach: As in the module, only layer h is read.
        h: The step.
        a: The move.
        cell: The searcher's column after it.
    """
    total = 0.0
    for k in range(graph.first[a], graph.first[a + 1]):
        there = graph.there[k, cell]
        if there >= 0:
            for s in range(chain.starts[h, there], chain.starts[h, there + 1]):
                total += reach[s] * miss[s] * graph.pods[k, chain.persons[s]] * (gain - later[s])
    return total


@compiled()
def counted_twice(chain, graph, gain, miss, later, reach, h, a, cell, before, cell_before):
    """Return the part of `gain_of` of persons whom the searcher's previous looks detect.

    Args:
        chain: This and the following arguments are those of `gain_of`.
        graph: As there.
        gain: As there.
        miss: As there.
        later: As there.
        reach: As there, layer h - 1 is read.
        h: As there.
        a: As there.
        cell: As there.
        before: A move with the looks of the previous step.
        cell_before: The column after it.
    """
    total = 0.0
    for k in range(graph.first[a], graph.first[a + 1]):
        there = graph.there[k, cell]
        if there < 0:
            continue
        low, high = chain.starts[h, there], chain.starts[h, there + 1]
        for j in range(graph.first[before], graph.first[before + 1]):
            from_cell = graph.there[j, cell_before]
            if from_cell < 0:
                continue
            for s in range(chain.starts[h - 1, from_cell], chain.starts[h - 1, from_cell + 1]):
                here = reach[s] * miss[s] * graph.pods[j, chain.persons[s]]
                if here <= 0.0:
                    continue
                for e in range(chain.first[s], chain.first[s + 1]):
                    n = chain.to[e]
                    if low <= n < high:
                        pod = graph.pods[k, chain.persons[n]]
                        total += here * chain.chance[e] * miss[n] * pod * (gain - later[n])
    return total


@compiled()
def bound_rest(
    chain, graph, gains, ends, miss, later, blocked, weights, h0, start, reach, cone, counts,
    marks, own, best,
):  # fmt: skip
    """Write bounds on what a searcher's looks from step h0 on add to the other searchers' plans.

    The sum of what each look adds alone counts a person several times whom several looks detect;
    this leaves out persons whom the look before detects (the bounds MEAN, Martins 1993, and DMEAN,
    Lau et al. 2008). The best path by this sum follows by dynamic programming.

    Args:
        chain: As in the module.
        graph: As in the module.
        gains: As in the module.
        ends: (C,) float64, value of ending in each column.
        miss: Of the other searchers.
        later: With the looks of the other searchers.
        blocked: As in the module.
        weights: (H, C) float64, factors on what a look in a column adds; (0, 0) for none, as
            factors make no bounds.
        h0: First step.
        start: The searcher's column before it.
        reach: In and out: layer h0 is in, the later ones are out.
        cone: (H + 1, C) int64 scratch.
        counts: (H + 1,) int64 scratch.
        marks: (C,) bool scratch, False in and out.
        own: (Q, C) float64 scratch.
        best: (H, Q, C) float64 out, by step, looks of the previous move and column before the step.
    """
    steps, num_moves = len(gains), len(graph.ahead)
    reach[chain.starts[h0 + 1, 0] :] = 0.0
    spread(chain, miss, reach, h0)
    cone[h0, 0], counts[h0] = start, 1
    for h in range(h0, steps):
        count = 0
        for i in range(counts[h]):
            for a in range(num_moves):
                cell = graph.ahead[a, cone[h, i]]
                if cell >= 0 and not blocked[h, cell] and not marks[cell]:
                    marks[cell] = True
                    cone[h + 1, count] = cell
                    count += 1
        counts[h + 1] = count
        for i in range(count):
            marks[cone[h + 1, i]] = False
    for h in range(steps - 1, h0 - 1, -1):
        for i in range(counts[h + 1]):
            cell = cone[h + 1, i]
            for q in range(len(graph.examples)):
                a = graph.examples[q]
                own[q, cell] = gain_of(chain, graph, gains[h], miss, later, reach, h, a, cell)
        for i in range(counts[h]):
            cell = cone[h, i]
            best[h, :, cell] = -np.inf
            for a in range(num_moves):
                after = graph.ahead[a, cell]
                if after < 0 or blocked[h, after]:
                    continue
                gain = own[graph.alike[a], after]
                weight = weights[h, after] if len(weights) else 1.0
                rest = best[h + 1, graph.alike[a], after] if h < steps - 1 else ends[after]
                for q in range(len(graph.examples)):
                    twice = 0.0
                    if h > h0 and gain > 0.0:
                        twice = counted_twice(
                            chain, graph, gains[h], miss, later, reach, h, a, after,
                            graph.examples[q], cell,
                        )  # fmt: skip
                    best[h, q, cell] = max(best[h, q, cell], weight * (gain - twice) + rest)


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


@compiled()
def worth_of_ends(left, worth, nearness, columns, ends):
    """Write what one more searcher that ends in these columns adds to the worth.

    Args:
        left: (C,) float64, the probability that the person is in a column and undetected.
        worth: (C,) float64, the worth of a person in each column without the searcher.
        nearness: (S, S) float64, see `path_problem.PathProblem`.
        columns: (E,) int64.
        ends: (C,) float64 in and out.
    """
    side = len(nearness)
    for i in np.flatnonzero(left):
        y, x = i // side, i % side
        for j in columns:
            near = nearness[abs(j // side - y), abs(j % side - x)]
            ends[j] += left[i] * max(near - worth[i], 0.0)


@compiled()
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
def best_path(
    chain, graph, gains, worth, ends, miss, blocked, weights, start, width, threshold, revisits,
    fixed, moves,
):  # fmt: skip
    """Find the path of a searcher that adds most to the plans of the others.

    It branches by step and keeps the paths with the greatest bounds. If it never has more than
    `width` of them, the path is optimal.

    Args:
        chain: As in the module.
        graph: As in the module.
        gains: As in the module.
        worth: As in the module.
        ends: As in `bound_rest`.
        miss: Of the other searchers.
        blocked: As in the module.
        weights: As in `bound_rest`.
        start: The searcher's column.
        width: Paths kept at each step.
        threshold: Only paths that add more than this count.
        revisits: Whether a path may be in a cell twice, including its start.
        fixed: Number of first moves that are given.
        moves: (H,) int64 out; the fixed moves are in.

    Returns:
        What the path adds, -inf if none adds more than `threshold`, and a bound on what any path
        adds.
    """
    steps, (num_moves, columns) = len(gains), graph.ahead.shape
    layers = chain.starts[:, -1] - chain.starts[:, 0]
    most = layers.max()
    later, reach = np.empty(chain.starts[-1, -1]), np.zeros(chain.starts[-1, -1])
    backward(chain, gains, worth, miss, later)
    cone, counts = np.empty((steps + 1, columns), np.int64), np.empty(steps + 1, np.int64)
    own = np.empty((len(graph.examples), columns))
    marks = np.zeros(columns, np.bool_)
    best = np.empty((steps, len(graph.examples), columns))
    cells, parents = np.empty((2, steps + 1, width), np.int64)
    taken = np.empty((steps + 1, width), np.int64)
    now, after = np.zeros((width, most)), np.zeros((width, most))
    added, next_added = np.zeros(width), np.zeros(width)
    tried = width * num_moves
    c_node, c_move = np.empty(tried, np.int64), np.empty(tried, np.int64)
    c_added, c_bound = np.empty(tried), np.empty(tried)
    now[0, : len(chain.prior)] = chain.prior
    cells[0, 0] = start
    nodes, dropped = 1, threshold
    for h in range(steps):
        low, size = chain.starts[h, 0], layers[h]
        found = 0
        for node in range(nodes):
            reach[low : low + size] = now[node, :size]
            if h >= fixed:
                bound_rest(
                    chain, graph, gains, ends, miss, later, blocked, weights, h, cells[h, node],
                    reach, cone, counts, marks, own, best,
                )  # fmt: skip
            for a in range(num_moves):
                if h < fixed and a != moves[h]:
                    continue
                cell = graph.ahead[a, cells[h, node]]
                if cell < 0 or blocked[h, cell]:
                    continue
                if not revisits and was_there(cells, parents, h, node, cell):
                    continue
                gain = gain_of(chain, graph, gains[h], miss, later, reach, h, a, cell)
                total = added[node] + gain
                rest = 0.0
                if h == steps - 1:
                    total += ends[cell]
                elif h >= fixed:
                    rest = best[h + 1, graph.alike[a], cell]
                weighted = gain * (weights[h, cell] - 1.0) if len(weights) else 0.0
                if h >= fixed and total + rest <= threshold:
                    continue
                c_node[found], c_move[found] = node, a
                c_added[found], c_bound[found] = total, total + rest + weighted
                found += 1
        if found == 0:
            return -np.inf, dropped
        order = np.argsort(-c_bound[:found])
        if found > width:
            dropped = max(dropped, c_bound[order[width]])
        nodes = min(found, width)
        for k in range(nodes):
            node, a = c_node[order[k]], c_move[order[k]]
            cell = graph.ahead[a, cells[h, node]]
            cells[h + 1, k], taken[h + 1, k], parents[h + 1, k] = cell, a, node
            next_added[k] = c_added[order[k]]
            if h == steps - 1:
                continue
            for i in range(size):
                reach[low + i] = now[node, i] * miss[low + i]
            multiply_misses_of_looks(chain, graph, h, a, cell, reach)
            after[k, : layers[h + 1]] = 0.0
            for s in range(low, low + size):
                if reach[s] > 0.0:
                    for e in range(chain.first[s], chain.first[s + 1]):
                        after[k, chain.to[e] - low - size] += reach[s] * chain.chance[e]
        now, after = after, now
        added, next_added = next_added, added
    node = int(np.argmax(added[:nodes]))
    total = added[node]
    for h in range(steps, 0, -1):
        moves[h - 1] = taken[h, node]
        node = parents[h, node]
    return total, max(dropped, total)


@compiled()
def look_values(chain, graph, gains, miss, later, reach, values):
    """Write what the looks of each move would add.

    Args:
        chain: As in the module.
        graph: As in the module.
        gains: As in the module.
        miss: As in the module.
        later: As in the module.
        reach: As in the module.
        values: (H, A, C) float64 out, by step, move and column after it.
    """
    for h in range(len(gains)):
        for a in range(len(graph.ahead)):
            for cell in range(graph.ahead.shape[1]):
                values[h, a, cell] = gain_of(chain, graph, gains[h], miss, later, reach, h, a, cell)


@compiled()
def longest(ahead, blocked, values, start, moves):
    """Find the path with the greatest sum of values, by dynamic programming; return the sum.

    Args:
        ahead: (A, C) of `SearchGraph`.
        blocked: (H, C) bool.
        values: (H, A, C) float64.
        start: The first column.
        moves: (H,) int64 out.
    """
    steps, num_moves, columns = values.shape
    best = np.full((steps + 1, columns), -np.inf)
    chosen = np.zeros((steps, columns), np.int64)
    best[steps] = 0.0
    for h in range(steps - 1, -1, -1):
        for cell in range(columns):
            for a in range(num_moves):
                after = ahead[a, cell]
                if after < 0 or blocked[h, after]:
                    continue
                total = values[h, a, after] + best[h + 1, after]
                if total > best[h, cell]:
                    best[h, cell], chosen[h, cell] = total, a
    cell = start
    for h in range(steps):
        moves[h] = chosen[h, cell]
        cell = ahead[moves[h], cell]
    return best[0, start]

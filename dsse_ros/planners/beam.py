# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled beam search of the planner `belief` for the best plans of a drone.

The value of a drone's plan is what it finds in M futures, see `Belief.futures`. See `plan_kernels`
for plans and their cells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.compiled.jit import compiled, inlined, part
from dsse_ros.planners.left_scenarios import Left, left_by_others, worth_from, worth_of
from dsse_ros.planners.plan_kernels import (
    UNIT,
    Moves,
    Scenarios,
    cell_seen,
    detects,
    seen_from,
    step_at,
)

CAP = 4
"""Nodes kept at each step in one cell."""
BUCKETS = 256
"""Of equal width, in which moves are sorted by rank: fewer mispredicted branches than quicksort."""
ONE, SIX, BITS = np.uint64(1), np.uint64(6), np.uint64(63)


class Tree(NamedTuple):
    """The nodes of a beam search: W of each step.

    Attributes:
        cells: (H + 1, W) int64.
        parents: (H + 1, W) int64, node of the step before.
    """

    cells: NDArray[np.int64]
    parents: NDArray[np.int64]


class BeamLevel(NamedTuple):
    """What the paths to the nodes of a step have found.

    Attributes:
        free: (W, M / 64) uint64, a bit for each scenario that nobody has found.
        shared: (W, M / 64) uint64, a bit for each that only other drones find.
        gains: (W,) int64 in `UNIT`, discounted finds beyond those of the other drones.
        late: (W,) float64, steps that the path has taken beyond one for each move.
        slowness: (W,) float64, gamma ** late.
        left: (W, E + 1) int64, number of free scenarios in each place, see `Left`.
        looks: (W,) int64, number of the path's looks that found some that nobody else finds.
        where: (W, H) int64, positions of these looks, see `Moves`.
        finds: (W, H) int64, what each of them found.
    """

    free: NDArray[np.uint64]
    shared: NDArray[np.uint64]
    gains: NDArray[np.int64]
    late: NDArray[np.float64]
    slowness: NDArray[np.float64]
    left: NDArray[np.int64]
    looks: NDArray[np.int64]
    where: NDArray[np.int64]
    finds: NDArray[np.int64]


class Discounts(NamedTuple):
    """Discounts of a find.

    Attributes:
        steps: (H,) float64, by the step.
        extra: (A,) float64, by what a move takes until it looks, beyond the first step.
        rest: (A,) float64, by what it takes after that.
    """

    steps: NDArray[np.float64]
    extra: NDArray[np.float64]
    rest: NDArray[np.float64]


class Problem(NamedTuple):
    """What a drone plans for.

    Attributes:
        moves: Of the drone's kind.
        scenarios: The scenarios.
        left: What the others leave of them.
        blocked: (H, S S) bool, cells that the drone must not be in after step h + 1.
        discounts: Of a find.
        kappa: Weight of the scenarios left at the end.
    """

    moves: Moves
    scenarios: Scenarios
    left: Left
    blocked: NDArray[np.bool_]
    discounts: Discounts
    kappa: float


class Candidates(NamedTuple):
    """Moves from the nodes of a step.

    Attributes:
        cells: (W A,) int64.
        parents: (W A,) int64.
        moves: (W A,) int64.
        gains: (W A,) int64 in `UNIT`.
        ranks: (W A,) float64 in `UNIT`, gains and the weighted worth of what is left.
    """

    cells: NDArray[np.int64]
    parents: NDArray[np.int64]
    moves: NDArray[np.int64]
    gains: NDArray[np.int64]
    ranks: NDArray[np.float64]


@inlined
def is_in(bits, s):
    """Return 1 if a scenario is in a set of bits, else 0, as int64."""
    return np.int64(bits[s >> SIX] >> (s & BITS) & ONE)


@inlined
def gain_of_move(problem, level, node, h, a, cell, worth):
    """Return what one more move gains a node, and its finds among the free scenarios.

    Args:
        problem: The problem.
        level: Of the node.
        node: Its number.
        h: Step in which the move looks.
        a: Number of the move.
        cell: The cell after it.
        worth: Of a find then.
    """
    moves, scenarios, base = problem.moves, problem.scenarios, problem.left.base
    free, shared = level.free[node], level.shared[node]
    gain = hits = np.int64(0)
    for look in range(moves.first[a], moves.first[a + 1]):
        there = cell_seen(moves, cell, look)
        if there < 0:
            continue
        members = scenarios.members[h, scenarios.starts[h, there] : scenarios.starts[h, there + 1]]
        others = np.int64(0)
        # Loops without branches, of which most would be predicted wrongly.
        for s in members:
            seen = np.int64(detects(moves, scenarios, h, look, s))
            hits += seen & is_in(free, s)
            others += seen & is_in(shared, s)
        if others > 0:
            for s in members:
                seen = np.int64(detects(moves, scenarios, h, look, s))
                gain += (seen & is_in(shared, s)) * max(0, worth - base[s])
    return gain + hits * worth, hits


@part
def expand(problem, tree, level, h, nodes, tried):
    """Write the moves from the nodes of a step, and return their number.

    Args:
        problem: The problem.
        tree: The nodes.
        level: Of the step.
        h: The step, if the path is not late.
        nodes: Number of its nodes.
        tried: `Candidates` out.
    """
    moves, left, discounts = problem.moves, problem.left, problem.discounts
    horizon, found = len(problem.blocked), 0
    for node in range(nodes):
        for a in range(len(moves.steps)):
            cell = tree.cells[h, node] + moves.steps[a]
            step = step_at(h, level.late[node] + moves.extra[a])
            if problem.blocked[min(step, horizon - 1), cell] or not moves.able[a]:
                continue
            gain, hits, slowness = 0, 0, level.slowness[node] * discounts.extra[a]
            if step < horizon:
                worth = int(discounts.steps[h] * slowness * UNIT)
                gain, hits = gain_of_move(problem, level, node, step, a, cell, worth)
            gain += level.gains[node]
            ahead, here = worth_from(moves, left, cell) - hits * UNIT, moves.positions[cell]
            for k in range(level.looks[node]):
                # Of the scenarios left, the path's own looks have found some.
                ahead -= level.finds[node, k] * seen_from(moves, here, level.where[node, k])
            tried.cells[found], tried.parents[found], tried.moves[found] = cell, node, a
            tried.gains[found] = gain
            tried.ranks[found] = gain + problem.kappa * slowness * discounts.rest[a] * ahead
            found += 1
    return found


@part
def sort_by_rank(ranks, order, starts):
    """Sort moves by rank, the best one first: in buckets, and then by insertion.

    Args:
        ranks: (F,) float64.
        order: (F,) int64 out, their numbers.
        starts: (BUCKETS + 1,) int64 scratch.
    """
    most = least = ranks[0]
    for rank in ranks:
        most, least = max(most, rank), min(least, rank)
    scale = (BUCKETS - 1) / (most - least) if most > least else 0.0
    starts[:] = 0
    for rank in ranks:
        starts[int((most - rank) * scale) + 1] += 1
    for bucket in range(BUCKETS):
        starts[bucket + 1] += starts[bucket]
    for k in range(len(ranks)):
        bucket = int((most - ranks[k]) * scale)
        order[starts[bucket]] = k
        starts[bucket] += 1
    for k in range(1, len(order)):
        number, at = order[k], k
        while at > 0 and ranks[order[at - 1]] < ranks[number]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = number


@part
def keep_best(problem, tree, level, h, tried, order, in_cell, after):
    """Keep the moves of the highest rank as the nodes of the next step, and return their number.

    Args:
        problem: The problem.
        tree: The nodes, in and out.
        level: Of the step.
        h: The step.
        tried: Of `expand`.
        order: (F,) int64, its moves in order of their ranks.
        in_cell: (S S,) int64 scratch, zeros in and out.
        after: `BeamLevel` out.
    """
    kept, width = 0, tree.cells.shape[1]
    for k in order:
        cell = tried.cells[k]
        if in_cell[cell] >= CAP or (in_cell[cell] and is_kept(tree, after, h + 1, kept, tried, k)):
            continue
        in_cell[cell] += 1
        tree.cells[h + 1, kept], tree.parents[h + 1, kept] = cell, tried.parents[k]
        take(problem, tried, k, level, h, after, kept)
        kept += 1
        if kept == width:
            break
    for k in range(kept):
        in_cell[tree.cells[h + 1, k]] = 0
    return kept


@inlined
def is_kept(tree, after, h, kept, tried, k):
    """Return whether there is a node with the cell and the gain of a move."""
    for node in range(kept):
        if tree.cells[h, node] == tried.cells[k] and after.gains[node] == tried.gains[k]:
            return True
    return False


@inlined
def take(problem, tried, k, level, h, after, kept):
    """Write to a node of the next level what the path to it has found.

    Args:
        problem: The problem.
        tried: The moves.
        k: Number of the move.
        level: Of the step before.
        h: Step of the move.
        after: `BeamLevel` out.
        kept: Number of the new node.
    """
    moves, discounts = problem.moves, problem.discounts
    node, a, looks = tried.parents[k], tried.moves[k], level.looks[tried.parents[k]]
    for word in range(level.free.shape[1]):
        after.free[kept, word] = level.free[node, word]
        after.shared[kept, word] = level.shared[node, word]
    for place in range(level.left.shape[1]):
        after.left[kept, place] = level.left[node, place]
    for look in range(looks):
        after.where[kept, look] = level.where[node, look]
        after.finds[kept, look] = level.finds[node, look]
    step = step_at(h, level.late[node] + moves.extra[a])
    after.gains[kept] = tried.gains[k]
    after.late[kept] = level.late[node] + moves.extra[a] + moves.rest[a]
    after.slowness[kept] = level.slowness[node] * discounts.extra[a] * discounts.rest[a]
    hits = 0
    if step < len(problem.blocked):
        for look in range(moves.first[a], moves.first[a + 1]):
            there = cell_seen(moves, tried.cells[k], look)
            if there >= 0:
                hits += remove(problem, step, look, there, after, kept)
    after.looks[kept] = looks
    if hits > 0:
        after.where[kept, looks], after.finds[kept, looks] = moves.positions[tried.cells[k]], hits
        after.looks[kept] += 1


@inlined
def remove(problem, h, look, cell, level, node):
    """Remove from a node what a look at step h detects in a cell; return its free scenarios."""
    moves, scenarios, places = problem.moves, problem.scenarios, problem.left.places
    free, shared, left = level.free[node], level.shared[node], level.left[node]
    hits = np.int64(0)
    members = scenarios.members[h, scenarios.starts[h, cell] : scenarios.starts[h, cell + 1]]
    for s in members:
        found = is_in(free, s) & np.int64(detects(moves, scenarios, h, look, s))
        left[places[s]] -= found
        hits += found
    # Members are in order: a word is written once.
    word, kept = np.uint64(0), ~np.uint64(0)
    for s in members:
        if s >> SIX != word:
            free[word] &= kept
            shared[word] &= kept
            word, kept = s >> SIX, ~np.uint64(0)
        kept &= ~(np.uint64(detects(moves, scenarios, h, look, s)) << (s & BITS))
    free[word] &= kept
    shared[word] &= kept
    return hits


@part
def write_values(problem, tree, level, depth, values):
    """Write the value of the path to each of the last nodes.

    Args:
        problem: The problem.
        tree: The nodes.
        level: Of the last step.
        depth: The last step.
        values: (nodes,) float64 out.
    """
    for node in range(len(values)):
        left = worth_of(problem.moves, problem.left, level.left[node], tree.cells[depth, node])
        values[node] = level.gains[node] + problem.kappa * level.slowness[node] * left


@compiled()
def new_level(width, words, places, horizon):
    """Return a level of W nodes that are not late."""
    return BeamLevel(
        np.empty((width, words), np.uint64),
        np.empty((width, words), np.uint64),
        np.zeros(width, np.int64),
        np.zeros(width),
        np.ones(width),
        np.empty((width, places), np.int64),
        np.zeros(width, np.int64),
        np.empty((width, horizon), np.int64),
        np.empty((width, horizon), np.int64),
    )


@compiled()
def plan_drone(moves, scenarios, gamma, kappa, width, others, blocked, paths):
    """Search for a drone's best plans, given those of the others.

    Args:
        moves: Of the drone's kind.
        scenarios: The scenarios.
        gamma: Discount of a find per step.
        kappa: Of `Problem`.
        width: Nodes kept at each step.
        others: (N, M) float64, credits of the plans of the other drones, 0 for the drone itself.
        blocked: Of `Problem`.
        paths: (V, H + 1) int64 out, the best plans, the best one first; the caller sets the first
            cells.

    Returns:
        The number of plans, and their length: less than the horizon if the blocked cells leave no
        path.
    """
    horizon, most = paths.shape[1] - 1, width * len(moves.steps)
    left = left_by_others(moves, scenarios, others)
    discounts = Discounts(gamma ** np.arange(horizon), gamma**moves.extra, gamma**moves.rest)
    problem = Problem(moves, scenarios, left, blocked, discounts, kappa)
    tree = Tree(np.empty((horizon + 1, width), np.int64), np.empty((horizon + 1, width), np.int64))
    words, places = (len(scenarios.ends) + 63) >> 6, len(left.counts)
    now, after = (
        new_level(width, words, places, horizon),
        new_level(width, words, places, horizon),
    )
    tried = Candidates(
        np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most, np.int64),
        np.empty(most, np.int64), np.empty(most),
    )  # fmt: skip
    starts, order = np.empty(BUCKETS + 1, np.int64), np.empty(most, np.int64)
    in_cell = np.zeros(len(moves.positions), np.int64)
    now.free[0], now.shared[0], now.left[0] = left.free, ~left.free, left.counts
    tree.cells[0, 0] = paths[0, 0]
    nodes, depth = 1, 0
    for h in range(horizon):
        found = expand(problem, tree, now, h, nodes, tried)
        if found == 0:
            break
        sort_by_rank(tried.ranks[:found], order[:found], starts)
        nodes = keep_best(problem, tree, now, h, tried, order[:found], in_cell, after)
        now, after, depth = after, now, h + 1
    worth = np.empty(nodes)
    write_values(problem, tree, now, depth, worth)
    return write_paths(tree, depth, np.argsort(-worth), paths), depth


@part
def write_paths(tree, depth, order, paths):
    """Write the paths to the last nodes in this order, (V, H + 1), and return their number."""
    found = min(len(order), len(paths))
    for k in range(found):
        node = order[k]
        for h in range(depth, 0, -1):
            paths[k, h] = tree.cells[h, node]
            node = tree.parents[h, node]
        for h in range(depth, paths.shape[1] - 1):
            paths[k, h + 1] = paths[k, h]
    return found

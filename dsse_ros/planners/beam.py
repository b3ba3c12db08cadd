# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled beam search of the planner `belief` for the best plans of a drone.

The value of a drone's plan is what it finds in M futures, see `Belief.futures`. See `plan_kernels`
for plans and their cells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import compiled, inlined, part
from dsse_ros.base.compiled.records import Int
from dsse_ros.planners.plan_kernels import (
    UNIT,
    Moves,
    Scenarios,
    cell_seen,
    detects,
    seen_from,
    step_at,
)
from dsse_ros.search.belief.motion_kernels import Flags, Floats, Ints

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
        left: (W, E + 1) int64, number of free scenarios in each place, see `Residual`.
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


class Residual(NamedTuple):
    """The scenarios that the plans of the other drones leave, by their places: cells at the end.

    Attributes:
        free: (M / 64,) uint64, a bit for each scenario that they do not find.
        base: (M,) int64 in `UNIT`, credit of the others' plans for each scenario.
        places: (M,) int64, place of each scenario; E if no free one ends there.
        counts: (E + 1,) int64, number of free scenarios in each place.
        positions: (E + 1,) int64, positions of the places, see `Moves`.
        worths: (S,) int64 in `UNIT`, their worth seen from a cell; -1 until it is computed.
    """

    free: NDArray[np.uint64]
    base: NDArray[np.int64]
    places: NDArray[np.int64]
    counts: NDArray[np.int64]
    positions: NDArray[np.int64]
    worths: NDArray[np.int64]


class Problem(NamedTuple):
    """What a drone plans for.

    Attributes:
        moves: Of the drone's kind.
        scenarios: The scenarios.
        residual: What the others leave of them.
        blocked: (H, S) bool, cells that the drone must not be in after step h + 1.
        discounts: Of a find.
        kappa: Weight of the scenarios left at the end.
    """

    moves: Moves
    scenarios: Scenarios
    residual: Residual
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
def is_in(bits: NDArray[np.uint64], s: int) -> np.int64:
    """Return 1 if a scenario is in a set of bits, else 0, as int64."""
    return np.int64(bits[s >> SIX] >> (s & BITS) & ONE)


@inlined
def gain_of_move(
    problem: Problem, level: BeamLevel, node: int, h: int, a: int, cell: int, worth: int
) -> tuple[np.int64, np.int64]:
    """Return what one more move gains a node, and its finds among the free scenarios.

    Args:
        h: Step in which the move looks.
        cell: The cell after it.
        worth: Of a find then.
    """
    moves, scenarios, base = problem.moves, problem.scenarios, problem.residual.base
    free, shared = level.free[node], level.shared[node]
    gain = hits = np.int64(0)
    for look in range(moves.starts[a], moves.starts[a + 1]):
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


@compiled()
def residual_of(moves: Moves, scenarios: Scenarios, others: Floats) -> Residual:
    """Return the scenarios that the plans of the others leave.

    Args:
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
    return Residual(
        free=free, base=base, places=numbers[scenarios.ends], counts=left, positions=positions,
        worths=np.full(len(counts), -1),
    )  # fmt: skip


@inlined
def worth_of(moves: Moves, residual: Residual, counts: Ints, cell: int) -> int:
    """Return the worth to a drone in a cell of as many scenarios at the end in each place."""
    total, here = 0, moves.positions[cell]
    for place in range(len(counts)):
        total += counts[place] * seen_from(moves, here, residual.positions[place])
    return total


@inlined
def worth_from(moves: Moves, residual: Residual, cell: int) -> int:
    """Return the worth of the scenarios left at the end to a drone in a cell."""
    if residual.worths[cell] < 0:
        residual.worths[cell] = worth_of(moves, residual, residual.counts, cell)
    return residual.worths[cell]


@part
def expand(
    problem: Problem, tree: Tree, level: BeamLevel, h: int, nodes: int, tried: Candidates
) -> int:
    """Write the moves from the nodes of a step, and return their number."""
    moves, residual, discounts = problem.moves, problem.residual, problem.discounts
    horizon, found = len(problem.blocked), 0
    for node in range(nodes):
        for a in range(len(moves.steps)):
            cell = tree.cells[h, node] + moves.steps[a]
            step = step_at(h, level.late[node] + moves.extra[a])
            if problem.blocked[min(step, horizon - 1), cell] or not moves.able[a]:
                continue
            gain: Int = 0
            hits: Int = 0
            slowness = level.slowness[node] * discounts.extra[a]
            if step < horizon:
                worth = int(discounts.steps[h] * slowness * UNIT)
                gain, hits = gain_of_move(problem, level, node, step, a, cell, worth)
            gain += level.gains[node]
            ahead, here = worth_from(moves, residual, cell) - hits * UNIT, moves.positions[cell]
            for k in range(level.looks[node]):
                # Of the scenarios left, the path's own looks have found some.
                ahead -= level.finds[node, k] * seen_from(moves, here, level.where[node, k])
            tried.cells[found], tried.parents[found], tried.moves[found] = cell, node, a
            tried.gains[found] = gain
            tried.ranks[found] = gain + problem.kappa * slowness * discounts.rest[a] * ahead
            found += 1
    return found


@part
def sort_by_rank(ranks: Floats, order: Ints, starts: Ints) -> None:
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
def keep_best(
    problem: Problem,
    tree: Tree,
    level: BeamLevel,
    h: int,
    tried: Candidates,
    order: Ints,
    in_cell: Ints,
    after: BeamLevel,
) -> int:
    """Keep the moves of the highest rank as the nodes of the next step, and return their number.

    Args:
        order: (F,) int64, its moves in order of their ranks.
        in_cell: (S,) int64 scratch, zeros in and out.
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
def is_kept(tree: Tree, after: BeamLevel, h: int, kept: int, tried: Candidates, k: int) -> bool:
    """Return whether there is a node with the cell and the gain of a move."""
    for node in range(kept):
        if tree.cells[h, node] == tried.cells[k] and after.gains[node] == tried.gains[k]:
            return True
    return False


@inlined
def take(
    problem: Problem,
    tried: Candidates,
    k: int,
    level: BeamLevel,
    h: int,
    after: BeamLevel,
    kept: int,
) -> None:
    """Write to a node of the next level what the path to it has found.

    Args:
        h: Step of the move.
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
    hits: Int = 0
    if step < len(problem.blocked):
        for look in range(moves.starts[a], moves.starts[a + 1]):
            there = cell_seen(moves, tried.cells[k], look)
            if there >= 0:
                hits += remove(problem, step, look, there, after, kept)
    after.looks[kept] = looks
    if hits > 0:
        after.where[kept, looks], after.finds[kept, looks] = moves.positions[tried.cells[k]], hits
        after.looks[kept] += 1


@inlined
def remove(problem: Problem, h: int, look: int, cell: int, level: BeamLevel, node: int) -> np.int64:
    """Remove from a node what a look at step h detects in a cell; return its free scenarios."""
    moves, scenarios, places = problem.moves, problem.scenarios, problem.residual.places
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
def write_values(
    problem: Problem, tree: Tree, level: BeamLevel, depth: int, values: Floats
) -> None:
    """Write the value of the path to each of the last nodes.

    Args:
        depth: The last step.
        values: (nodes,) float64 out.
    """
    for node in range(len(values)):
        left = worth_of(problem.moves, problem.residual, level.left[node], tree.cells[depth, node])
        values[node] = level.gains[node] + problem.kappa * level.slowness[node] * left


@compiled()
def new_level(width: int, words: int, places: int, horizon: int) -> BeamLevel:
    """Return a level of W nodes that are not late."""
    return BeamLevel(
        free=np.empty((width, words), np.uint64),
        shared=np.empty((width, words), np.uint64),
        gains=np.zeros(width, np.int64),
        late=np.zeros(width),
        slowness=np.ones(width),
        left=np.empty((width, places), np.int64),
        looks=np.zeros(width, np.int64),
        where=np.empty((width, horizon), np.int64),
        finds=np.empty((width, horizon), np.int64),
    )


@compiled()
def plan_drone(
    moves: Moves,
    scenarios: Scenarios,
    gamma: float,
    kappa: float,
    width: int,
    others: Floats,
    blocked: Flags,
    paths: Ints,
) -> tuple[int, int]:
    """Search for a drone's best plans, given those of the others.

    Args:
        others: (N, M) float64, credits of the plans of the other drones, 0 for the drone itself.
        blocked: Of `Problem`.
        paths: (V, H + 1) int64 out, the best plans, the best one first; the caller sets the first
            cells.

    Returns:
        The number of plans, and their length: less than the horizon if the blocked cells leave no
        path.
    """
    horizon, most = paths.shape[1] - 1, width * len(moves.steps)
    residual = residual_of(moves, scenarios, others)
    discounts = Discounts(gamma ** np.arange(horizon), gamma**moves.extra, gamma**moves.rest)
    problem = Problem(
        moves=moves, scenarios=scenarios, residual=residual, blocked=blocked, discounts=discounts,
        kappa=kappa,
    )  # fmt: skip
    tree = Tree(np.empty((horizon + 1, width), np.int64), np.empty((horizon + 1, width), np.int64))
    words, places = (len(scenarios.ends) + 63) >> 6, len(residual.counts)
    now, after = (
        new_level(width, words, places, horizon),
        new_level(width, words, places, horizon),
    )
    tried = Candidates(
        cells=np.empty(most, np.int64), parents=np.empty(most, np.int64),
        moves=np.empty(most, np.int64), gains=np.empty(most, np.int64), ranks=np.empty(most),
    )  # fmt: skip
    starts, order = np.empty(BUCKETS + 1, np.int64), np.empty(most, np.int64)
    in_cell = np.zeros(len(moves.positions), np.int64)
    now.free[0], now.shared[0], now.left[0] = residual.free, ~residual.free, residual.counts
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
def write_paths(tree: Tree, depth: int, order: Ints, paths: Ints) -> int:
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

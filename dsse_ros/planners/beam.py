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

from dsse_ros.belief.belief_kernels import MARGIN
from dsse_ros.compiled.jit import compiled, inlined, part
from dsse_ros.planners.plan_kernels import Moves, Scenarios, cell_seen, detects, step_at

CAP = 4
"""Nodes kept at each step in one cell."""
ONE, EIGHT, BYTE = np.uint64(1), np.uint64(8), np.uint64(255)


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
        alive: (W, M / 64) uint64, a bit for each scenario that the path's own looks left.
        gains: (W,) float64, discounted finds in addition to those of the other drones.
        late: (W,) float64, steps that the path has taken beyond one for each move.
        finds: (W, H) float64, finds of each step among the scenarios that nobody else finds.
    """

    alive: NDArray[np.uint64]
    gains: NDArray[np.float64]
    late: NDArray[np.float64]
    finds: NDArray[np.float64]


class Left(NamedTuple):
    """The scenarios that the plans of the other drones leave, by their cells at the end.

    Attributes:
        base: (M,) float64, credit of the other drones' plans for each scenario.
        free: (M / 64,) uint64, a bit for each scenario that they do not find.
        counts: (S S,) float64, number of scenarios left in each cell.
        places: (E,) int64, the cells with any.
        worths: (S S,) float64, their worth seen from a cell; -1 until it is computed.
        x: (S S,) int64, column of a cell: divisions would take most of the time.
        y: (S S,) int64, its row.
    """

    base: NDArray[np.float64]
    free: NDArray[np.uint64]
    counts: NDArray[np.float64]
    places: NDArray[np.int64]
    worths: NDArray[np.float64]
    x: NDArray[np.int64]
    y: NDArray[np.int64]


class Problem(NamedTuple):
    """What a drone plans for.

    Attributes:
        moves: Of the drone's kind.
        scenarios: The scenarios.
        left: What the others leave of them.
        blocked: (H, S S) bool, cells that the drone must not be in after step h + 1.
        gamma: Discount of a find per step.
        kappa: Weight of the scenarios left at the end.
    """

    moves: Moves
    scenarios: Scenarios
    left: Left
    blocked: NDArray[np.bool_]
    gamma: float
    kappa: float


class OwnFinds(NamedTuple):
    """The finds of the looks of a path, the last one first.

    Attributes:
        cells: (H,) int64, where the drone was.
        finds: (H,) float64, among the scenarios that nobody else finds.
    """

    cells: NDArray[np.int64]
    finds: NDArray[np.float64]


class Candidates(NamedTuple):
    """Moves from the nodes of a step.

    Attributes:
        cells: (W A,) int64.
        parents: (W A,) int64.
        moves: (W A,) int64.
        gains: (W A,) float64.
        ranks: (W A,) float64, gains and the weighted worth of what is left.
    """

    cells: NDArray[np.int64]
    parents: NDArray[np.int64]
    moves: NDArray[np.int64]
    gains: NDArray[np.float64]
    ranks: NDArray[np.float64]


@compiled()
def left_by_others(scenarios, side, others):
    """Return the scenarios that the plans of the others leave.

    Args:
        scenarios: The scenarios.
        side: S.
        others: (N, M) float64, credits of their plans, 0 for the drone itself.
    """
    base, counts = np.zeros(len(scenarios.ends)), np.zeros(side * side)
    free = np.zeros((len(base) + 63) >> 6, np.uint64)
    for n in range(len(others)):
        for s in range(len(base)):
            base[s] = max(base[s], others[n, s])
    for s in range(len(base)):
        if base[s] == 0.0:
            counts[scenarios.ends[s]] += 1.0
            free[s >> 6] |= ONE << np.uint64(s & 63)
    x, y = np.empty(side * side, np.int64), np.empty(side * side, np.int64)
    for i in range(side):
        for j in range(side):
            x[i * side + j], y[i * side + j] = j, i
    return Left(base, free, counts, np.flatnonzero(counts), np.full(side * side, -1.0), x, y)


@inlined
def seen_from(moves, left, i, j):
    """Return the worth of a scenario in cell j at the end to a drone in cell i."""
    return moves.nearness[abs(left.y[i] - left.y[j]), abs(left.x[i] - left.x[j])]


@inlined
def worth_from(moves, left, cell):
    """Return the worth of the scenarios left at the end to a drone in a cell."""
    if left.worths[cell] < 0.0:
        total = 0.0
        for place in left.places:
            total += left.counts[place] * seen_from(moves, left, cell, place)
        left.worths[cell] = total
    return left.worths[cell]


@inlined
def discount_of(gamma, late):
    """Return the discount of a find by the steps that a path is late; most paths are not."""
    return gamma**late if late > 0.0 else 1.0


@inlined
def gain_of_move(problem, alive, h, a, cell, gain, discount):
    """Return a node's gain with one more move, and its finds among the scenarios left.

    Args:
        problem: The problem.
        alive: (M / 64,) of the node, as in `BeamLevel`.
        h: Step in which the move looks.
        a: Number of the move.
        cell: The cell after it.
        gain: Of the node.
        discount: Of a find then.
    """
    moves, scenarios, base = problem.moves, problem.scenarios, problem.left.base
    hits, sure = 0, len(scenarios.draws) == 0
    for k in range(moves.first[a], moves.first[a + 1]):
        there = cell_seen(moves, cell, k)
        if there < 0:
            continue
        members = scenarios.members[h, scenarios.starts[h, there] : scenarios.starts[h, there + 1]]
        for s in members:
            is_alive = alive[s >> 6] >> np.uint64(s & 63) & ONE
            if sure:
                # Without a branch, which would often be predicted wrongly.
                gain += is_alive * max(0.0, discount - base[s])
                hits += is_alive * (base[s] == 0.0)
            elif is_alive and detects(moves, scenarios, h, k, s):
                gain += max(0.0, discount - base[s])
                hits += base[s] == 0.0
    return gain, float(hits)


@inlined
def own_finds(tree, level, h, node, own):
    """Write where the looks of the path to a node have found scenarios; return their number."""
    count, at = 0, node
    for back in range(h, 0, -1):
        if level.finds[node, back - 1] > 0.0:
            own.cells[count], own.finds[count] = tree.cells[back, at], level.finds[node, back - 1]
            count += 1
        at = tree.parents[back, at]
    return count


@part
def expand(problem, tree, level, own, tried, h, nodes, discount):
    """Write the moves from the nodes of a step to `tried`, and return their number.

    Args:
        problem: The problem.
        tree: The nodes.
        level: Of the step.
        own: `OwnFinds` scratch.
        tried: `Candidates` out.
        h: The step, if the path is not late.
        nodes: Number of its nodes.
        discount: gamma ** h.
    """
    moves, left = problem.moves, problem.left
    side, found = len(moves.nearness), 0
    for node in range(nodes):
        seen = own_finds(tree, level, h, node, own)
        for a in range(len(moves.steps)):
            cell = tree.cells[h, node] + moves.steps[a]
            x, y = left.x[cell], left.y[cell]
            if min(x, y) < MARGIN or max(x, y) >= side - MARGIN:
                continue
            late = level.late[node] + moves.extra[a]
            step = step_at(h, late)
            if problem.blocked[min(step, len(problem.blocked) - 1), cell] or not moves.able[a]:
                continue
            gain, hits = level.gains[node], 0.0
            if step < len(problem.blocked):
                worth = discount * discount_of(problem.gamma, late)
                gain, hits = gain_of_move(problem, level.alive[node], step, a, cell, gain, worth)
            rank = worth_from(moves, left, cell) - hits
            for k in range(seen):
                # Of the scenarios left, the path's own looks have found some.
                rank -= own.finds[k] * seen_from(moves, left, cell, own.cells[k])
            tried.cells[found], tried.parents[found], tried.moves[found] = cell, node, a
            tried.gains[found] = gain
            tried.ranks[found] = (
                gain + problem.kappa * discount_of(problem.gamma, late + moves.rest[a]) * rank
            )
            found += 1
    return found


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
    moves, scenarios, node, a = problem.moves, problem.scenarios, tried.parents[k], tried.moves[k]
    for word in range(level.alive.shape[1]):
        after.alive[kept, word] = level.alive[node, word]
    for back in range(h):
        after.finds[kept, back] = level.finds[node, back]
    step = step_at(h, level.late[node] + moves.extra[a])
    after.late[kept] = level.late[node] + moves.extra[a] + moves.rest[a]
    after.finds[kept, h] = 0.0
    if step >= len(problem.blocked):
        return
    hits = 0.0
    for look in range(moves.first[a], moves.first[a + 1]):
        there = cell_seen(moves, tried.cells[k], look)
        if there < 0:
            continue
        for j in range(scenarios.starts[step, there], scenarios.starts[step, there + 1]):
            s = scenarios.members[step, j]
            bit = np.uint64(1) << np.uint64(s & 63)
            if after.alive[kept, s >> 6] & bit and detects(moves, scenarios, step, look, s):
                after.alive[kept, s >> 6] ^= bit
                hits += problem.left.base[s] == 0.0
    after.finds[kept, h] = hits


@part
def keep_best(problem, tree, level, h, tried, order, after, in_cell):
    """Keep the moves of the highest rank as the nodes of the next step, and return their number.

    Args:
        problem: The problem.
        tree: The nodes, in and out.
        level: Of the step.
        h: The step.
        tried: Of `expand`.
        order: (F,) int64, its moves in order of their ranks.
        after: `BeamLevel` out.
        in_cell: (S S,) int64 scratch, zeros in and out.
    """
    kept, width = 0, tree.cells.shape[1]
    for k in order:
        cell = tried.cells[k]
        if in_cell[cell] >= CAP:
            continue
        same = False
        for other in range(kept):
            if tree.cells[h + 1, other] == cell and after.gains[other] == tried.gains[k]:
                same = True
                break
        if same:
            continue
        in_cell[cell] += 1
        tree.cells[h + 1, kept], tree.parents[h + 1, kept] = cell, tried.parents[k]
        after.gains[kept] = tried.gains[k]
        take(problem, tried, k, level, h, after, kept)
        kept += 1
        if kept == width:
            break
    for k in range(kept):
        in_cell[tree.cells[h + 1, k]] = 0
    return kept


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
    moves, left = problem.moves, problem.left
    for node in range(len(values)):
        cell = tree.cells[depth, node]
        value = worth_from(moves, left, cell)
        for word in range(level.alive.shape[1]):
            found, s = ~level.alive[node, word] & left.free[word], 64 * word
            while found:
                # Most bytes are empty.
                while not found & BYTE:
                    found, s = found >> EIGHT, s + 8
                if found & ONE:
                    value -= seen_from(moves, left, cell, problem.scenarios.ends[s])
                found, s = found >> ONE, s + 1
        values[node] = (
            level.gains[node] + problem.kappa * discount_of(problem.gamma, level.late[node]) * value
        )


@compiled()
def new_level(width, words, horizon):
    """Return a level of W nodes."""
    return BeamLevel(
        np.empty((width, words), np.uint64),
        np.zeros(width),
        np.zeros(width),
        np.zeros((width, horizon)),
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
    side, horizon = len(moves.nearness), paths.shape[1] - 1
    words, most = (len(scenarios.ends) + 63) >> 6, width * len(moves.steps)
    left = left_by_others(scenarios, side, others)
    problem = Problem(moves, scenarios, left, blocked, gamma, kappa)
    tree = Tree(np.empty((horizon + 1, width), np.int64), np.empty((horizon + 1, width), np.int64))
    now, after = new_level(width, words, horizon), new_level(width, words, horizon)
    tried = Candidates(
        np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most, np.int64),
        np.empty(most), np.empty(most),
    )  # fmt: skip
    own = OwnFinds(np.empty(horizon, np.int64), np.empty(horizon))
    in_cell = np.zeros(side * side, np.int64)
    now.alive[0] = ~np.uint64(0)
    tree.cells[0, 0] = paths[0, 0]
    nodes, depth, discount = 1, 0, 1.0
    for h in range(horizon):
        found = expand(problem, tree, now, own, tried, h, nodes, discount)
        if found == 0:
            break
        order = np.argsort(-tried.ranks[:found])
        nodes = keep_best(problem, tree, now, h, tried, order, after, in_cell)
        now, after, depth = after, now, h + 1
        discount *= gamma
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

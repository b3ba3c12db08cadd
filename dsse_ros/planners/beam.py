# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled parts of the planner `belief`: a beam search on futures of the persons.

The value of a drone's plan is what it finds in M futures, see `Belief.futures`. A plan is a path of
H + 1 cells, the present one first; staying in a cell searches it. Cells are the columns of a
belief, see `belief_kernels`. Arguments with the same names mean the same everywhere:

    moves: (A,) int64, what each move adds to a cell's number; 0, the search, comes first.
    first: (A + 1,) int64, the looks of move a are first[a] .. first[a + 1] - 1.
    offsets: (L, 2) int64, (dx, dy) of a look from the cell that the move leads to.
    pods: (L, P) float64, POD of each person.
    persons: (M,) as in `Futures`.
    draws: (H, M) float64 in [0, 1), which a POD must exceed to detect the person of a future;
        (0, 0) if every look has a POD of 1.
    starts, members: See `future_kernels.index`.
"""

from __future__ import annotations

import numpy as np

from dsse_ros.belief.belief_kernels import MARGIN
from dsse_ros.compiled.jit import compiled


@compiled()
def column_at(side, cell, dx, dy):
    """Return the cell at this offset from another one, -1 off the grid."""
    x, y = cell % side + dx, cell // side + dy
    if min(x, y) < MARGIN or max(x, y) >= side - MARGIN:
        return -1
    return y * side + x


@compiled()
def detects(draws, pods, persons, h, k, s):
    """Return whether look k at step h detects the person of scenario s in that cell."""
    return len(draws) == 0 or draws[h, s] < pods[k, persons[s]]


@compiled()
def move_between(moves, cell, after):
    """Return the number of the move from a cell to another one."""
    for a in range(len(moves)):
        if cell + moves[a] == after:
            return a
    return -1


@compiled()
def looks_of_plans(paths, lengths, kinds, moves, first, offsets, side, steps, columns, rows):
    """Write the looks of plans, step by step, and return their number.

    Args:
        paths: (N, H + 1) int64.
        lengths: (N,) int64, number of planned steps of each path.
        kinds: (N,) int64, kinds of the drones.
        moves: As in the module.
        first: (K, A + 1) int64, as in the module, by kind.
        offsets: As in the module.
        side: S.
        steps: (Q,) int64 out.
        columns: (Q,) int64 out.
        rows: (Q,) int64 out, the number of the look.
    """
    count = 0
    for h in range(paths.shape[1] - 1):
        for n in range(len(paths)):
            a = -1
            if h < lengths[n]:
                a = move_between(moves, paths[n, h], paths[n, h + 1])
            if a < 0:
                continue
            for k in range(first[kinds[n], a], first[kinds[n], a + 1]):
                there = column_at(side, paths[n, h + 1], offsets[k, 0], offsets[k, 1])
                if there >= 0:
                    steps[count], columns[count], rows[count] = h, there, k
                    count += 1
    return count


@compiled()
def credit_plan(
    path, length, gamma, side, moves, first, offsets, pods, persons, draws, starts, members, credit
):
    """Write the credit of a plan for each scenario: gamma ** (step of its first find), or 0.

    Args:
        path: (H + 1,) int64.
        length: Number of planned steps.
        gamma: Discount per step.
        side: S.
        moves: This and the following arguments are as in the module.
        first: For the drone's kind.
        offsets: (L, 2) int64.
        pods: (L, P) float64.
        persons: (M,) int64.
        draws: (H, M) float64.
        starts: (H, S S + 1) int64.
        members: (H, M) int64.
        credit: (M,) float64 out.
    """
    credit[:] = 0.0
    worth = 1.0
    for h in range(length):
        a = move_between(moves, path[h], path[h + 1])
        if a >= 0:
            for k in range(first[a], first[a + 1]):
                there = column_at(side, path[h + 1], offsets[k, 0], offsets[k, 1])
                if there < 0:
                    continue
                for j in range(starts[h, there], starts[h, there + 1]):
                    s = members[h, j]
                    if detects(draws, pods, persons, h, k, s):
                        credit[s] = max(credit[s], worth)
        worth *= gamma


@compiled()
def seen_from(nearness, x, y, i, j):
    """Return the worth of a scenario in cell j at the end to a drone in cell i."""
    return nearness[abs(y[i] - y[j]), abs(x[i] - x[j])]


@compiled()
def plan_drone(
    moves, first, offsets, pods, persons, draws, starts, members,
    width, cap, gamma, kappa, nearness, ends, credits, drone, blocked, horizon, paths,
):  # fmt: skip
    """Search for a drone's best plans, given those of the others.

    Args:
        moves: This and the following arguments are as in the module.
        first: For the drone's kind.
        offsets: (L, 2) int64.
        pods: (L, P) float64.
        persons: (M,) int64.
        draws: (H, M) float64.
        starts: (H, S S + 1) int64.
        members: (H, M) int64.
        width: Nodes kept at each step.
        cap: Nodes kept at each step in one cell.
        gamma: Discount per step.
        kappa: Weight of the scenarios left at the end.
        nearness: (S, S) float64, worth of a scenario left at the end by its distance, [y, x].
        ends: (M,) int64, cells of the scenarios at the end.
        credits: (N, M) float64, of all plans; the function ignores the drone's own.
        drone: Number of the drone.
        blocked: (H, S S) bool, cells that the drone must not be in after step h + 1.
        horizon: Steps to plan.
        paths: (V, H + 1) int64 out, the best plans, the best one first; the caller sets the first
            cells.

    Returns:
        The number of plans, and their length: less than the horizon if the blocked cells leave no
        path.
    """
    count, side = len(ends), len(nearness)
    # Look up coordinates: divisions would take most of the time.
    x, y = np.empty(side * side, np.int64), np.empty(side * side, np.int64)
    for i in range(side):
        for j in range(side):
            x[i * side + j], y[i * side + j] = j, i
    base = np.zeros(count)
    for n in range(len(credits)):
        if n != drone:
            for s in range(count):
                base[s] = max(base[s], credits[n, s])
    # Scenarios left at the end, by cell, and their worth seen from a cell, computed on first use.
    left = np.zeros(side * side)
    for s in range(count):
        if base[s] == 0.0:
            left[ends[s]] += 1.0
    places = np.flatnonzero(left)
    worths = np.full(side * side, -1.0)

    words = (count + 63) >> 6
    alive, after = np.empty((width, words), np.uint64), np.empty((width, words), np.uint64)
    full = ~np.uint64(0)
    alive[0] = full
    cells = np.empty((horizon + 1, width), np.int64)
    parents = np.empty((horizon + 1, width), np.int64)
    gains, next_gains = np.zeros(width), np.zeros(width)
    tried = width * len(moves)
    c_cell, c_parent = np.empty(tried, np.int64), np.empty(tried, np.int64)
    c_move, c_gain, c_rank = np.empty(tried, np.int64), np.empty(tried), np.empty(tried)
    in_cell = np.zeros(side * side, np.int64)
    # The finds of a node's searches so far, to subtract from the scenarios that are left.
    finds, next_finds = np.zeros((width, horizon)), np.zeros((width, horizon))
    cells[0, 0] = paths[0, 0]
    nodes, depth, discount = 1, 0, 1.0
    for h in range(horizon):
        found = 0
        for node in range(nodes):
            for a in range(len(moves)):
                cell = cells[h, node] + moves[a]
                if min(x[cell], y[cell]) < MARGIN or max(x[cell], y[cell]) >= side - MARGIN:
                    continue
                if blocked[h, cell]:
                    continue
                gain, hits = gains[node], 0.0
                for k in range(first[a], first[a + 1]):
                    there = column_at(side, cell, offsets[k, 0], offsets[k, 1])
                    if there < 0:
                        continue
                    for j in range(starts[h, there], starts[h, there + 1]):
                        s = members[h, j]
                        left_alive = alive[node, s >> 6] >> np.uint64(s & 63) & np.uint64(1)
                        if left_alive and detects(draws, pods, persons, h, k, s):
                            gain += max(0.0, discount - base[s])
                            hits += base[s] == 0.0
                if worths[cell] < 0.0:
                    total = 0.0
                    for place in places:
                        total += left[place] * seen_from(nearness, x, y, cell, place)
                    worths[cell] = total
                rank = worths[cell] - hits
                at, back = node, h
                while back > 0:
                    if finds[node, back - 1] > 0.0:
                        rank -= finds[node, back - 1] * seen_from(
                            nearness, x, y, cell, cells[back, at]
                        )
                    at = parents[back, at]
                    back -= 1
                c_cell[found], c_parent[found], c_move[found] = cell, node, a
                c_gain[found], c_rank[found] = gain, gain + kappa * rank
                found += 1
        if found == 0:
            break
        order = np.argsort(-c_rank[:found])
        kept = 0
        for k in order:
            cell, node = c_cell[k], c_parent[k]
            if in_cell[cell] >= cap:
                continue
            same = False
            for other in range(kept):
                if cells[h + 1, other] == cell and next_gains[other] == c_gain[k]:
                    same = True
                    break
            if same:
                continue
            in_cell[cell] += 1
            cells[h + 1, kept], parents[h + 1, kept] = cell, node
            next_gains[kept] = c_gain[k]
            for word in range(words):
                after[kept, word] = alive[node, word]
            for back in range(h):
                next_finds[kept, back] = finds[node, back]
            hits = 0.0
            for look in range(first[c_move[k]], first[c_move[k] + 1]):
                there = column_at(side, cell, offsets[look, 0], offsets[look, 1])
                if there < 0:
                    continue
                for j in range(starts[h, there], starts[h, there + 1]):
                    s = members[h, j]
                    bit = np.uint64(1) << np.uint64(s & 63)
                    if after[kept, s >> 6] & bit and detects(draws, pods, persons, h, look, s):
                        after[kept, s >> 6] ^= bit
                        hits += base[s] == 0.0
            next_finds[kept, h] = hits
            kept += 1
            if kept == width:
                break
        for k in range(kept):
            in_cell[cells[h + 1, k]] = 0
        alive, after = after, alive
        gains, next_gains = next_gains, gains
        finds, next_finds = next_finds, finds
        nodes, depth = kept, h + 1
        discount *= gamma
    values = np.empty(nodes)
    for node in range(nodes):
        cell = cells[depth, node]
        value = worths[cell]
        for word in range(words):
            if alive[node, word] == full:
                continue
            for s in range(64 * word, min(64 * word + 64, count)):
                if base[s] == 0.0 and not alive[node, word] >> np.uint64(s & 63) & np.uint64(1):
                    value -= seen_from(nearness, x, y, cell, ends[s])
        values[node] = gains[node] + kappa * value
    found = min(nodes, len(paths))
    order = np.argsort(-values)
    for k in range(found):
        node = order[k]
        for h in range(depth, 0, -1):
            paths[k, h] = cells[h, node]
            node = parents[h, node]
        for h in range(depth, horizon):
            paths[k, h + 1] = paths[k, h]
    return found, depth


@compiled()
def worth_of_left(left, nearness, end):
    """Return the worth of the persons left at the end to a drone in a cell.

    Args:
        left: (S S,) float64, the probability that a person is in a cell and was not found.
        nearness: As in `plan_drone`.
        end: The drone's cell.
    """
    side = len(nearness)
    worth = 0.0
    for y in range(side):
        for x in range(side):
            worth += left[y * side + x] * nearness[abs(y - end // side), abs(x - end % side)]
    return worth

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled filter: motion of a belief about persons, and its update after a failed search.

A belief is (C K, S S) float64. Row m K + k is for the persons of detection class m and drift k;
columns are the cells row by row, S = G + 2 `MARGIN` along a side. Persons who walked off the grid
(`person_walks_blind`) are in its margin. Steps to neighbours are numbered as in `targets.motion`.

The sea is that of `sea_map`; the motions in `targets` set the probabilities of a person's steps.
See `search_outcomes` for searches for several persons, and `follow_kernels` for the step of many
beliefs.
"""

from __future__ import annotations

from dsse_ros.compiled.jit import inlined, kernel, part
from dsse_ros.targets.motion import CHANCES, NO_STEP, SCRATCH, STAND_STILL, STEPS
from dsse_ros.targets.person_kernels import DRIFT_RANGES, gathered_step, own_drift, step_chances
from dsse_ros.targets.sea_map import cell_probability, drift_per_step, map_step, step_within

MARGIN = 3
"""Cells around the grid: one from which a person can return, one from which it cannot, and one that
is always empty, so that every cell has neighbours."""

ROW = CHANCES + STEPS + SCRATCH
"""Length of the array that `transition` writes to."""

NEGLIGIBLE = 1e-13
"""Probability below which a cell counts as empty. Otherwise a belief in a few cells would spread
over the whole grid, and every cell would need a table."""


NOTHING_LEFT = 1e-9
"""Remaining share of a belief below which it is impossible: nobody can be in its cells."""


@part
def index_of(c, x, y):
    """Return the column of a belief for a cell."""
    return (y + MARGIN) * (c.grid_size + 2 * MARGIN) + x + MARGIN


@part
def offset_of(c, step):
    """Return the offset from the column of a cell to that of its neighbour."""
    return (step // 3 - 1) * (c.grid_size + 2 * MARGIN) + step % 3 - 1


@part
def is_lost(c, i):
    """Return whether a column is so far off the grid that no window reaches it."""
    side = c.grid_size + 2 * MARGIN
    x, y = i % side, i // side
    return x <= 1 or y <= 1 or x >= side - 2 or y >= side - 2


@kernel
def start_sea(constants, worlds, drifts):
    """Set map and drifts to their state in `recipe.start_world` before the first step.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        worlds: (1,) of `kernels.WORLDS`, with start and vector set; its generator is not used.
        drifts: (K,) of `motion.PERSONS` out. If each person has an own drift, these are the middles
            of K equally probable ranges of its angle.
    """
    c, w, count = constants[0], worlds[0], len(drifts)
    w.t = w.map_steps = 0
    w.datum_x = w.circle_x = w.start_x
    w.datum_y = w.circle_y = w.start_y
    w.remainder_x = w.remainder_y = 0.0
    w.drift_x, w.drift_y = drift_per_step(c, w.vector_x, w.vector_y)
    w.scale = 0.0
    for k in range(count):
        drifts[k].remainder_x = drifts[k].remainder_y = 0.0
        if c.own_drift:
            place = DRIFT_RANGES * (k + 0.5) / count
            number = int(place)
            drifts[k].drift_x, drifts[k].drift_y = own_drift(c, w, number, place - number)


@kernel
def forecast_step(constants, worlds, sea, circle, drifts, chances, directions, apart, still):
    """Advance map and drifts by one step and write the values that set the persons' next step.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        worlds: (1,) of `kernels.WORLDS`.
        sea: Of the world.
        circle: (G + 1,) int64 scratch.
        drifts: (K,) of `motion.PERSONS`.
        chances: (S S,) float64 out, the probability of every cell that persons look at.
        directions: (K,) int64 out, the direction of each drift, see `PersonMotion`, or
            `STAND_STILL`.
        apart: (K,) bool out, the drifts whose persons are still where they were scattered to, each
            in a separate cell.
        still: (K,) bool in and out, the same before the next step.
    """
    c, w = constants[0], worlds[0]
    if not c.person_first:
        map_step(c, w, sea, circle)
    chances[:] = 0.0
    for y in range(c.grid_size):
        for x in range(c.grid_size):
            chances[index_of(c, x, y)] = cell_probability(c, w, sea.gauss, sea.area, x, y)
    for k in range(len(drifts)):
        directions[k] = gathered_step(drifts[k]) if c.own_drift else NO_STEP
        apart[k] = still[k]
        still[k] = still[k] and directions[k] == STAND_STILL
    if c.person_first:
        map_step(c, w, sea, circle)


@part
def step_of_drift(c, area, x, y, direction):
    """Return the step from a cell of the grid whose probability a drift in this direction raises.

    It stays within the grid and the area.
    """
    dx, dy = direction % 3 - 1, direction // 3 - 1
    to_x, to_y = step_within(area, c.grid_size, x, y, dx, dy)
    return 3 * (to_y - y + 1) + to_x - x + 1


@part
def transition(c, sea, chances, i, row):
    """Write the table column of a cell, from the persons' motion.

    Args:
        c: The constants.
        sea: Of the scenario.
        chances: (S S,) of `forecast_step`.
        i: Column of the cell.
        row: (`ROW`,) float64; the first `CHANCES` are out, the rest is scratch.
    """
    if is_lost(c, i):
        row[:CHANCES] = 0.0
        row[NO_STEP] = 1.0
        return
    side = c.grid_size + 2 * MARGIN
    window, scratch = row[CHANCES : CHANCES + STEPS], row[CHANCES + STEPS :]
    for step in range(STEPS):
        window[step] = chances[i + offset_of(c, step)]
    x, y = i % side - MARGIN, i // side - MARGIN
    step_chances(c, sea, x, y, window, row[:CHANCES], scratch)


@part
def complete(c, sea, chances, table, i, row):
    """Compute the column of a cell in a table, if it is not known yet.

    Args:
        c: The constants.
        sea: Of the scenario.
        chances: (S S,) of `forecast_step`.
        table: (`CHANCES`, S S) float64; the first row is negative in columns not known yet.
        i: Column of the cell.
        row: (`ROW`,) float64 scratch.
    """
    if table[0, i] < 0.0:
        transition(c, sea, chances, i, row)
        for k in range(CHANCES):
            table[k, i] = row[k]


@part
def look_up(c, sea, chances, table, i, direction, row):
    """Write the probabilities (9,) of the steps from a cell.

    Args:
        c: The constants.
        sea: Of the scenario.
        chances: (S S,) of `forecast_step`.
        table: Of `complete`.
        i: Column of the cell.
        direction: Of `forecast_step`.
        row: (`ROW`,) float64 out, the rest is scratch.
    """
    complete(c, sea, chances, table, i, row)
    for step in range(STEPS):
        row[step] = table[step, i]
    if table[STEPS, i] > 0.0:
        side = c.grid_size + 2 * MARGIN
        x, y = i % side - MARGIN, i // side - MARGIN
        row[step_of_drift(c, sea.area, x, y, direction)] += table[STEPS, i]


@inlined
def add_products(out, a, ta, b, tb, c, tc, d, td, e, te, f, tf, g, tg, h, th, i, ti):
    """Write the sum of nine products of equally long arrays; the compiler vectorizes this form."""
    for j in range(len(out)):
        out[j] = (
            a[j] * ta[j] + b[j] * tb[j] + c[j] * tc[j]
            + d[j] * td[j] + e[j] * te[j] + f[j] * tf[j]
            + g[j] * tg[j] + h[j] * th[j] + i[j] * ti[j]
        )  # fmt: skip


@part
def gather(now, table, after, low, high, side):
    """Write the probability that steps from all cells bring to the cells low..high - 1."""
    # The cells where the steps 8 to 0 start.
    a, b, c = low - side - 1, low - side, low - side + 1
    d, e, f = low - 1, low, low + 1
    g, h, i = low + side - 1, low + side, low + side + 1
    n = high - low
    add_products(
        after[low:high],
        now[a : a + n], table[8, a : a + n], now[b : b + n], table[7, b : b + n],
        now[c : c + n], table[6, c : c + n], now[d : d + n], table[5, d : d + n],
        now[e : e + n], table[4, e : e + n], now[f : f + n], table[3, f : f + n],
        now[g : g + n], table[2, g : g + n], now[h : h + n], table[1, h : h + n],
        now[i : i + n], table[0, i : i + n],
    )  # fmt: skip


@part
def drop_negligible(now, known):
    """Empty the negligible cells of a row; return how many other cells the table lacks."""
    unknown = 0
    for i in range(len(now)):
        here = now[i] if now[i] > NEGLIGIBLE else 0.0
        now[i] = here
        unknown += (here > 0.0) & (known[i] < 0.0)
    return unknown


@part
def add_drift(c, area, y, now, added, direction, after):
    """Add the drift's contribution to a step from the cells of grid row y, see `complete`."""
    start, end = index_of(c, 0, y), index_of(c, c.grid_size, y)
    inner = 0
    if area is None and 0 < y < c.grid_size - 1:
        # All cells but the first and the last allow the drift's step.
        inner = c.grid_size - 2
        low = start + offset_of(c, direction) + 1
        out, shares = after[low : low + inner], now[start + 1 : end - 1]
        chances = added[start + 1 : end - 1]
        for j in range(inner):
            out[j] += shares[j] * chances[j]
    for i in range(start, end, inner + 1):
        if now[i] > 0.0:
            step = step_of_drift(c, area, i - start, y, direction)
            after[i + offset_of(c, step)] += now[i] * added[i]


@part
def move_row(c, sea, now, chances, table, direction, after, row):
    """Advance one row of a belief by the persons' step, see `predict`."""
    count, side = len(now), c.grid_size + 2 * MARGIN
    unknown = drop_negligible(now, table[0])
    first, last = 0, count
    while first < count and now[first] == 0.0:
        first += 1
    while last > first and now[last - 1] == 0.0:
        last -= 1
    if unknown > 0:
        for i in range(first, last):
            if now[i] > 0.0:
                complete(c, sea, chances, table, i, row)
    low, high = max(first - side - 1, side + 1), min(last + side + 1, count - side - 1)
    gather(now, table, after, low, high, side)
    if c.own_drift:
        for y in range(first // side - MARGIN, (last - 1) // side - MARGIN + 1):
            add_drift(c, sea.area, y, now, table[STEPS], direction, after)
    for i in range(low, high):
        now[i] = after[i]


@kernel
def predict(constants, sea, belief, chances, table, directions, scratch):
    """Advance a belief by the persons' step; its sum does not change.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        sea: Of the scenario.
        belief: (C K, S S) float64.
        chances: (S S,) of `forecast_step`.
        directions: (K,) of `forecast_step`.
        table: Of `complete`.
        scratch: (S S + `ROW`,) float64.
    """
    c, count = constants[0], belief.shape[1]
    after, row = scratch[:count], scratch[count:]
    for k in range(len(belief)):
        direction = directions[k % len(directions)]
        if direction != STAND_STILL:
            move_row(c, sea, belief[k], chances, table, direction, after, row)


@kernel
def search(constants, belief, pods, x, y):
    """Update a belief with a failed search of a cell.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        belief: (C K, S S) float64.
        pods: (C,) float64, probability of detection.
        x: Column of the cell; a search off the grid has no effect.
        y: Row of the cell.

    Returns:
        The probability removed.
    """
    c = constants[0]
    if not (0 <= x < c.grid_size and 0 <= y < c.grid_size):
        return 0.0
    i = index_of(c, x, y)
    drifts = len(belief) // len(pods)
    taken = 0.0
    for k in range(len(belief)):
        part_taken = belief[k, i] * pods[k // drifts]
        belief[k, i] -= part_taken
        taken += part_taken
    return taken


@part
def total_of(shares):
    """Return a sum, from eight partial sums, because each addition waits for the previous one."""
    a = b = c = d = e = f = g = h = 0.0
    eights = len(shares) // 8
    for j in range(0, 8 * eights, 8):
        a += shares[j]
        b += shares[j + 1]
        c += shares[j + 2]
        d += shares[j + 3]
        e += shares[j + 4]
        f += shares[j + 5]
        g += shares[j + 6]
        h += shares[j + 7]
    for j in range(8 * eights, len(shares)):
        a += shares[j]
    return ((a + b) + (c + d)) + ((e + f) + (g + h))


@kernel
def normalise(belief):
    """Scale a belief so that it sums to 1; return its previous sum.

    A belief with sum 0 is not scaled.
    """
    total = 0.0
    for k in range(belief.shape[0]):
        total += total_of(belief[k])
    if total > 0.0:
        scale = 1.0 / total
        for k in range(belief.shape[0]):
            for i in range(belief.shape[1]):
                belief[k, i] *= scale
    return total


@part
def detectable(c, belief, pods, x, y):
    """Return the probability that `search` would remove, 0 off the grid."""
    if not (0 <= x < c.grid_size and 0 <= y < c.grid_size):
        return 0.0
    i, drifts, share = index_of(c, x, y), len(belief) // len(pods), 0.0
    for k in range(len(belief)):
        share += belief[k, i] * pods[k // drifts]
    return share

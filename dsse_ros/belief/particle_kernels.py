# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled filter of an ensemble: searches change the weights of its particles.

Weights are (C, M) float64: row m is for the persons of detection class m, and sums to their share
of all persons. `cells` (M, 2) int16 are the present cells of the particles, or (T, M, 2) the cells
by step of the sea. Persons move independently: nobody is `APART`. Other arguments are as in
`search_outcomes`.

A pass over the particles links those of the cells that the looks of a step see, so that a look
visits no others. `heads` (G G + 1,) int32, zeros in and out, has the first particle of each such
cell plus one, or -1; `links` (M,) int32 has the next one of the same cell plus one, or -1.
"""

from __future__ import annotations

import numpy as np

from dsse_ros.belief.belief_kernels import MARGIN, NOTHING_LEFT, total_of
from dsse_ros.belief.look_kernels import list_looks
from dsse_ros.belief.search_outcomes import (
    APART,
    LEFT_MIXED,
    MIXED,
    TOTAL,
    conclude,
    mean_found,
    open_classes,
    weigh_classes,
)
from dsse_ros.compiled.jit import compiled, kernel, part
from dsse_ros.targets.sea_map import is_inside, is_open


@part
def link(c, area, cells, seen, count, heads, links):
    """Link the particles of each cell that the looks see, in their order.

    Args:
        c: The constants.
        area: Of `sea_map.Sea`.
        cells: (M, 2) int16.
        seen: (Q, 2) int64, columns and rows of the cells looked at.
        count: Number of looks.
        heads: As in the module, out.
        links: As in the module, out.
    """
    g = c.grid_size
    for q in range(count):
        if is_open(area, g, seen[q, 0], seen[q, 1]):
            heads[seen[q, 1] * g + seen[q, 0]] = -1
    for k in range(len(cells) - 1, -1, -1):
        col, row = np.int64(cells[k, 0]), np.int64(cells[k, 1])
        # Without a branch, which would often be predicted wrongly.
        cell = row * g + col if is_inside(g, col, row) else g * g
        head = heads[cell]
        if head != 0:
            links[k] = head
            heads[cell] = k + 1


@part
def unlink(c, area, seen, count, heads):
    """Set `heads` to zeros again; arguments as in `link`."""
    for q in range(count):
        if is_open(area, c.grid_size, seen[q, 0], seen[q, 1]):
            heads[seen[q, 1] * c.grid_size + seen[q, 0]] = 0


@part
def learn_look(
    c, area, weights, pods, class_of, missing, unfound, numbers, hazard, heads, links, x, y, found
):  # fmt: skip
    """Update the weights with the outcome of the search of a cell.

    Call it for all searches of a step between `open_classes` and `close_weights`.

    Args:
        c: The constants.
        area: Of `sea_map.Sea`.
        weights: (C, M) float64, in and out.
        pods: (C,) float64, POD of this search.
        class_of: (n,) int64.
        missing: (n,) float64, in and out.
        unfound: (n,) float64, in and out.
        numbers: (`OF_CLASS`, C) float64.
        hazard: (n,) float64 scratch.
        heads: Of `link`.
        links: Of `link`.
        x: Column of the cell; a search off the grid or outside the area has no effect.
        y: Row of the cell.
        found: Whether the search found somebody.
    """
    if not is_open(area, c.grid_size, x, y):
        return
    first = heads[y * c.grid_size + x]
    for m in range(len(pods)):
        here, k = 0.0, first
        while k > 0:
            here += weights[m, k - 1]
            k = links[k - 1]
        numbers[APART, m] = 0.0
        numbers[MIXED, m] = here / numbers[TOTAL, m] if numbers[TOTAL, m] > 0.0 else 0.0
    if not conclude(c, pods, class_of, missing, unfound, numbers, hazard, found):
        return
    if len(missing) == 1:
        # A single person counts as missing until the mission is over.
        missing[0] = 1.0
    for m in range(len(pods)):
        k = first
        while k > 0:
            weights[m, k - 1] *= numbers[LEFT_MIXED, m]
            k = links[k - 1]


@part
def close_weights(weights, class_of, numbers, prior):
    """Scale each class to its share of all persons; an empty class restarts from `prior`.

    Args:
        weights: (C, M) float64, in and out.
        class_of: (n,) int64.
        numbers: (`OF_CLASS`, C) float64.
        prior: (M,) float64, the weights of the ensemble, which sum to 1.
    """
    open_classes(class_of, numbers)
    for m in range(len(weights)):
        share, total = numbers[TOTAL, m], total_of(weights[m])
        if total < NOTHING_LEFT * share:
            for k in range(len(prior)):
                weights[m, k] = prior[k]
            total = total_of(prior)
        scale = share / total
        for k in range(len(prior)):
            weights[m, k] *= scale


@kernel
def learn(
    constants, area, cells, weights, prior, heads, links, class_of, missing, unfound, pos, numbers,
    hazard, seen, rows, pods, failed, count,
):  # fmt: skip
    """Update the weights with the looks of a step; return the new POS.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        area: Of `sea_map.Sea`.
        cells: (M, 2) int16.
        weights: (C, M) float64, in and out.
        prior: (M,) of `close_weights`.
        heads: (G G + 1,) int32 scratch, zeros in and out.
        links: (M,) int32 scratch.
        class_of: (n,) int64.
        missing: (n,) float64, in and out.
        unfound: (n,) float64, in and out.
        pos: The POS before the step.
        numbers: (`OF_CLASS`, C) float64 scratch.
        hazard: (n,) float64 scratch.
        seen: (Q, 2) int64, columns and rows of the cells looked at.
        rows: (Q,) int64, the row of `pods` of each look.
        pods: (L, C) float64.
        failed: Number of looks that found nobody; they come first.
        count: Number of looks.
    """
    if count == 0:
        return pos
    c = constants[0]
    open_classes(class_of, numbers)
    link(c, area, cells, seen, count, heads, links)
    for q in range(count):
        learn_look(
            c, area, weights, pods[rows[q]], class_of, missing, unfound, numbers, hazard, heads,
            links, seen[q, 0], seen[q, 1], q >= failed,
        )  # fmt: skip
    unlink(c, area, seen, count, heads)
    close_weights(weights, class_of, numbers, prior)
    return mean_found(unfound)


@kernel
def write_poc(constants, area, cells, weights, class_of, missing, scale, out):
    """Write the missing persons' probability of every cell, out (G, G) as [y, x].

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        area: Of `sea_map.Sea`; outside it nothing is written.
        cells: (M, 2) int16.
        weights: (C, M) float64.
        class_of: (n,) int64.
        missing: (n,) float64.
        scale: (C,) float64 scratch.
        out: Out.
    """
    c = constants[0]
    weigh_classes(class_of, missing, scale)
    for y in range(c.grid_size):
        for x in range(c.grid_size):
            out[y, x] = 0.0
    for m in range(len(weights)):
        for k in range(len(cells)):
            col, row = np.int64(cells[k, 0]), np.int64(cells[k, 1])
            if is_open(area, c.grid_size, col, row):
                out[row, col] += scale[m] * weights[m, k]


@kernel
def follow_particles(
    constants, area, worlds, drones, finds, kinds, looks, offsets, actions, live, done,
    cells, prior, pods, class_of, first_step,
    weights, missing, unfound, pos,
    numbers, hazard, seen, rows, heads, links,
    first, last,
):  # fmt: skip
    """Update the beliefs of the worlds first..last - 1 after a step.

    Args:
        constants: See `follow_kernels.Followed`.
        area: See `Followed`.
        worlds: See `Followed`.
        drones: See `Followed`.
        finds: See `Followed`.
        kinds: See `Followed`.
        looks: See `Followed`.
        offsets: See `Followed`.
        actions: See `Followed`.
        live: See `Followed`.
        done: See `Followed`.
        cells: (T, M, 2) int16.
        prior: (M,) of `close_weights`.
        pods: (L, C) float64.
        class_of: (n,) int64.
        first_step: Steps of the sea before a mission's first observation.
        weights: (B, C, M) float64, in and out.
        missing: (B, n) float64, in and out.
        unfound: (B, n) float64, in and out.
        pos: (B,) float64, in and out.
        numbers: (`OF_CLASS`, C) float64 scratch.
        hazard: (n,) float64 scratch.
        seen: (Q, 2) int64 scratch, of `list_looks`.
        rows: (Q,) int64 scratch, of `list_looks`.
        heads: As in `learn`.
        links: As in `learn`.
        first: Number of the first world.
        last: Number of the last world, plus one.
    """
    c = constants[0]
    for b in range(first, last):
        of_world = weights[b]
        if c.auto_reset and done[b]:
            open_classes(class_of, numbers)
            for m in range(len(of_world)):
                for k in range(len(prior)):
                    of_world[m, k] = numbers[TOTAL, m] * prior[k]
            missing[b, :] = 1.0
            unfound[b, :] = 1.0
            pos[b] = 0.0
            continue
        step = worlds[b].t - 1
        if not (c.time_out_acts or step < c.timestep_limit + c.time_out_grace):
            continue
        now = cells[min(first_step + step, len(cells) - 1)]
        failed, count = list_looks(
            c, drones[b], finds[b], kinds, looks, offsets, actions[b], live[b], seen, rows
        )
        pos[b] = learn(
            constants, area, now, of_world, prior, heads, links, class_of, missing[b], unfound[b],
            pos[b], numbers, hazard, seen, rows, pods, failed, count,
        )  # fmt: skip


@kernel
def write_particles(
    constants, area, worlds, cells, first_step, weights, class_of, missing, scale, maps, first, last
):  # fmt: skip
    """Write the probability of every cell of the worlds first..last - 1, (B, G, G) as [y, x].

    The arguments are those of `follow_particles` and `write_poc`.
    """
    c = constants[0]
    for b in range(first, last):
        now = cells[min(first_step + worlds[b].t, len(cells) - 1)]
        write_poc(constants, area, now, weights[b], class_of, missing[b], scale, maps[b])
        for y in range(c.grid_size):
            for x in range(c.grid_size):
                # Rounding may put a sum of shares above 1.
                maps[b, y, x] = min(maps[b, y, x], 1.0)


@compiled()
def expect_particles(
    starts, members, weights, steps, looked, pods, first, horizon, gamma, grid_size, left
):  # fmt: skip
    """Return the discounted finds of future looks, exactly for the particles.

    Args:
        starts: (T, S S + 1) int32, see `members`.
        members: (T, M) int32, the particles sorted by column, see `future_kernels.index`; after the
            last step of the sea nothing moves.
        weights: (C, M) float64, of the missing persons.
        steps: (Q,) of `LooksToCome`.
        looked: (Q,) int64, the columns of `LooksToCome`.
        pods: (Q, C) float64.
        first: Step of the sea now.
        horizon: H.
        gamma: Discount per step.
        grid_size: G.
        left: (S S,) float64 out, final distribution of the persons not found.
    """
    kept = weights.copy()
    side = grid_size + 2 * MARGIN
    last = len(members) - 1
    worth, value, q = 1.0, 0.0, 0
    for h in range(horizon):
        start, member = starts[min(first + h, last)], members[min(first + h, last)]
        while q < len(steps) and steps[q] == h:
            cell = looked[q]
            x, y = cell % side - MARGIN, cell // side - MARGIN
            if 0 <= x < grid_size and 0 <= y < grid_size:
                for k in member[start[cell] : start[cell + 1]]:
                    for m in range(len(kept)):
                        taken = kept[m, k] * pods[q, m]
                        kept[m, k] -= taken
                        value += worth * taken
            q += 1
        worth *= gamma
    start, member = starts[min(first + horizon, last)], members[min(first + horizon, last)]
    for cell in range(len(left)):
        left[cell] = 0.0
        for k in member[start[cell] : start[cell + 1]]:
            for m in range(len(kept)):
                left[cell] += kept[m, k]
    return value

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled forecast of a belief: sampled futures, future searches, and the Markov chain."""

from __future__ import annotations

import math

import numpy as np

from dsse_ros.belief.belief_kernels import (
    BOTTOM,
    LEFT,
    MARGIN,
    RIGHT,
    ROW,
    TOP,
    Mass,
    look_up,
    offset_of,
    search,
    step_at,
    stored_at,
)
from dsse_ros.belief.layer_kernels import predict
from dsse_ros.belief.protocol import Expected
from dsse_ros.compiled.jit import compiled, part
from dsse_ros.targets.motion import NO_STEP, STAND_STILL, STEPS

GOLDEN = 0.6180339887498949
"""Its multiples modulo 1 fill [0, 1) evenly, so neighbours in a sample draw different steps."""


@part
def sort_by_cell(cells, starts, members):
    """Sort the futures at a step by cell; arguments are as in `index`, at this step."""
    starts[:] = 0
    for s in range(len(cells)):
        starts[cells[s] + 1] += 1
    for i in range(1, len(starts)):
        starts[i] += starts[i - 1]
    for s in range(len(cells)):
        members[starts[cells[s]]] = s
        starts[cells[s]] += 1
    # Each cell now has the start of the next one.
    for i in range(len(starts) - 1, 0, -1):
        starts[i] = starts[i - 1]
    starts[0] = 0


@compiled()
def index(cells, starts, members):
    """Sort futures by cell in each step.

    Args:
        cells: (H or more, M) as in `Futures`.
        starts: (H, S S + 1) integers out, as there.
        members: (H, M) integers out, as there.
    """
    for h in range(len(starts)):
        sort_by_cell(cells[h], starts[h], members[h])


@compiled()
def sample(mass, weights, count, offset, rows, cells):
    """Draw scenarios systematically: each cell gets its share of them, rounded up or down.

    Args:
        mass: The belief.
        weights: (C,) float64, factors with which it sums to about 1.
        count: M.
        offset: In [0, 1).
        rows: (M,) int64 out, the row of the belief.
        cells: (M,) int64 out, the column.
    """
    drawn, total, last_row, last_cell = 0, 0.0, 0, 0
    drifts, side = len(mass.layers) // len(weights), int(math.sqrt(mass.layers.shape[1]))
    for k in range(len(mass.layers)):
        box = mass.boxes[k]
        for y in range(box[TOP], box[BOTTOM]):
            for x in range(box[LEFT], box[RIGHT]):
                i = y * side + x
                share = mass.layers[k, stored_at(box, x, y)] * weights[k // drifts]
                if share <= 0.0:
                    continue
                total += share
                last_row, last_cell = k, i
                while drawn < count and drawn + offset < total * count:
                    rows[drawn], cells[drawn] = k, i
                    drawn += 1
    for s in range(drawn, count):
        rows[s], cells[s] = last_row, last_cell


@compiled()
def roll(constants, sea, steps, slots, offsets, rows, futures):
    """Advance the persons of all futures by their steps.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        sea: Of a `Forecast`.
        steps: Of a `Forecast`.
        slots: (H,) int64, indices of the steps in the forecast.
        offsets: (H,) float64 in [0, 1), offsets of the draws.
        rows: (M,) of `sample`.
        futures: The first row of their cells is in, the rest is out.
    """
    row = np.empty(ROW)
    spread = np.empty(len(rows))
    drifts = rows % steps.directions.shape[1]
    for s in range(len(rows)):
        spread[s] = s * GOLDEN - math.floor(s * GOLDEN)
    for h in range(len(slots)):
        step, directions = step_at(steps, slots[h]), steps.directions[slots[h]]
        now, after = futures.cells[h], futures.cells[h + 1]
        sort_by_cell(now, futures.starts[h], futures.members[h])
        seen_cell, seen_direction = -1, -1
        for s in futures.members[h]:
            i, direction = now[s], directions[drifts[s]]
            if direction == STAND_STILL:
                after[s] = i
                continue
            if i != seen_cell or direction != seen_direction:
                look_up(constants[0], sea, step, i, direction, row)
                for number in range(1, STEPS):
                    row[number] += row[number - 1]
                seen_cell, seen_direction = i, direction
            drawn = offsets[h] + spread[s]
            drawn -= 1.0 if drawn >= 1.0 else 0.0
            number = 0
            for k in range(STEPS - 1):
                number += drawn >= row[k]
            after[s] = i + offset_of(constants[0], number)


@compiled()
def expect(constants, sea, mass, steps, slots, looks, gamma, scratch):
    """Return what plans are expected to find, by the exact filter; see `TargetBelief`.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        sea: Of a `Forecast`.
        mass: The belief.
        steps: Of a `Forecast`.
        slots: (H,) int64, indices of the steps in the forecast.
        looks: A `LooksToCome` with PODs (Q, C) by detection class.
        gamma: Discount per step.
        scratch: Of `layer_kernels.predict`.
    """
    side, plans = constants[0].grid_size + 2 * MARGIN, len(looks.first) - 1
    expected = Expected(np.zeros(plans), np.zeros((plans, side * side)))
    for v in range(plans):
        left = Mass(mass.layers.copy(), mass.boxes.copy(), mass.cells.copy(), mass.totals.copy())
        worth, q = 1.0, looks.first[v]
        for h in range(len(slots)):
            while q < looks.first[v + 1] and looks.steps[q] == h:
                y, x = divmod(looks.columns[q], side)
                found = search(constants[0], left, looks.pods[q], x - MARGIN, y - MARGIN)
                expected.finds[v] += worth * found
                q += 1
            predict(constants, sea, left, step_at(steps, slots[h]), scratch)
            worth *= gamma
        for m in range(len(left.cells)):
            expected.left[v] += left.cells[m]
    return expected


@compiled()
def number_states(density, starts):
    """Number the states of a layer, the cells with a probability, column by column.

    Args:
        density: (C K, S S) float64.
        starts: (S S + 1,) int64 in and out: the first number is in, see `TargetChain`.

    Returns:
        (C K, S S) int64, the number of each cell's state, -1 for none, and (N,) int64, the row of
        each state.
    """
    numbers = np.full(density.shape, -1)
    rows = np.empty(density.size, np.int64)
    state = starts[0]
    for i in range(density.shape[1]):
        starts[i] = state
        for k in range(len(density)):
            if density[k, i] > 0.0:
                numbers[k, i], rows[state - starts[0]] = state, k
                state += 1
    starts[-1] = state
    return numbers, rows[: state - starts[0]].copy()


@compiled()
def chain_layer(constants, sea, step, starts, rows, numbers):
    """Return the steps from the states of a layer.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        sea: Of a `Forecast`.
        step: One step of a `Forecast`.
        starts: (S S + 1,) of `number_states`.
        rows: (N,) of `number_states`.
        numbers: (C K, S S) of `number_states`, for the next layer.

    Returns:
        (N,) int64, the number of steps from each state; (E,) int64, the states that they lead to;
        (E,) float64, their probabilities.
    """
    directions, count, base = step.directions, 0, starts[0]
    row = np.empty(ROW)
    counts = np.zeros(len(rows), np.int64)
    to, chance = np.empty(STEPS * len(rows), np.int64), np.empty(STEPS * len(rows))
    for i in range(len(starts) - 1):
        for s in range(starts[i] - base, starts[i + 1] - base):
            k = rows[s]
            direction = directions[k % len(directions)]
            if direction == STAND_STILL:
                row[:STEPS] = 0.0
                row[NO_STEP] = 1.0
            else:
                look_up(constants[0], sea, step, i, direction, row)
            for number in range(STEPS):
                if row[number] > 0.0:
                    n = numbers[k, i + offset_of(constants[0], number)]
                    if n >= 0:
                        to[count], chance[count] = n, row[number]
                        counts[s] += 1
                        count += 1
    return counts, to[:count].copy(), chance[:count].copy()

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""The compiled forecast of a belief: sampled futures, future searches, and the Markov chain."""

from __future__ import annotations

import math

import numpy as np

from dsse_ros.belief.belief_kernels import MARGIN, ROW, look_up, offset_of, search, step_at
from dsse_ros.belief.layer_kernels import predict
from dsse_ros.compiled.jit import compiled
from dsse_ros.targets.motion import NO_STEP, STAND_STILL, STEPS

GOLDEN = 0.6180339887498949
"""Its multiples modulo 1 fill [0, 1) evenly, so neighbours in a sample draw different steps."""


@compiled()
def index(cells, starts, members):
    """Sort the scenarios of each step by cell.

    Args:
        cells: (H or more, M) as in `Futures`.
        starts: (H, S S + 1) integers out.
        members: (H, M) integers out: those in cell i at step h are, in increasing order,
            members[h, starts[h, i] : starts[h, i + 1]].
    """
    for h in range(len(starts)):
        start = starts[h]
        start[:] = 0
        for s in range(cells.shape[1]):
            start[cells[h, s] + 1] += 1
        for i in range(1, len(start)):
            start[i] += start[i - 1]
        place = start[:-1].copy()
        for s in range(cells.shape[1]):
            members[h, place[cells[h, s]]] = s
            place[cells[h, s]] += 1


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
    drifts = len(mass.layers) // len(weights)
    for k in range(len(mass.layers)):
        for i in range(mass.spans[k, 0], mass.spans[k, 1]):
            share = mass.layers[k, i] * weights[k // drifts]
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
def roll(constants, sea, steps, slots, offsets, rows, cells):
    """Advance the persons of all scenarios by their steps.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        sea: Of a `Forecast`.
        steps: Of a `Forecast`.
        slots: (H,) int64, indices of the steps in the forecast.
        offsets: (H,) float64 in [0, 1), offsets of the draws.
        rows: (M,) of `sample`.
        cells: (H + 1, M) int64; the first row is in, the others are out.
    """
    row = np.empty(ROW)
    for h in range(len(slots)):
        step, directions = step_at(steps, slots[h]), steps.directions[slots[h]]
        now, after = cells[h], cells[h + 1]
        seen_cell, seen_direction = -1, -1
        for s in range(len(rows)):
            i, direction = now[s], directions[rows[s] % len(directions)]
            if direction == STAND_STILL:
                after[s] = i
                continue
            if i != seen_cell or direction != seen_direction:
                look_up(constants[0], sea, step, i, direction, row)
                seen_cell, seen_direction = i, direction
            left = offsets[h] + s * GOLDEN
            left -= math.floor(left)
            number = 0
            while number < STEPS - 1 and left >= row[number]:
                left -= row[number]
                number += 1
            after[s] = i + offset_of(constants[0], number)


@compiled()
def expect(constants, sea, mass, steps, slots, looks, gamma, scratch):
    """Return the discounted finds of future looks, by the exact filter.

    Args:
        constants: (1,) of `constants.CONSTANTS`.
        sea: Of a `Forecast`.
        mass: The belief; afterwards the final distribution of the persons not found.
        steps: Of a `Forecast`.
        slots: (H,) int64, indices of the steps in the forecast.
        looks: A `LooksToCome` with PODs (Q, C) by detection class.
        gamma: Discount per step.
        scratch: Of `layer_kernels.predict`.
    """
    side = constants[0].grid_size + 2 * MARGIN
    worth, value, q = 1.0, 0.0, 0
    for h in range(len(slots)):
        while q < len(looks.steps) and looks.steps[q] == h:
            y, x = divmod(looks.columns[q], side)
            value += worth * search(constants[0], mass, looks.pods[q], x - MARGIN, y - MARGIN)
            q += 1
        predict(constants, sea, mass, step_at(steps, slots[h]), scratch)
        worth *= gamma
    return value


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

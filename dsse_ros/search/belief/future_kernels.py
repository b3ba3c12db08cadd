# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The compiled forecast of a belief: sampled futures and future searches."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.compiled.jit import compiled, part
from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.belief.component_kernels import Mass, apply_failed_search, place_of
from dsse_ros.search.belief.component_motion import predict
from dsse_ros.search.belief.motion_kernels import (
    MARGIN,
    ROW,
    Floats,
    Ints,
    MotionTables,
    move_probabilities,
    offset_of,
    pitch_of,
    tables_at,
)
from dsse_ros.search.belief.protocol import Expected, Futures, LooksToCome
from dsse_ros.world.targets.motion import STAND_STILL, STEPS
from dsse_ros.world.targets.sea_map import Sea

GOLDEN = 0.6180339887498949
"""Its multiples modulo 1 fill [0, 1) evenly, so neighbours in a sample draw different steps."""


@part
def sort_by_cell(
    cells: NDArray[np.integer[Any]],
    starts: NDArray[np.integer[Any]],
    members: NDArray[np.integer[Any]],
) -> None:
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
def index(
    cells: NDArray[np.integer[Any]],
    starts: NDArray[np.integer[Any]],
    members: NDArray[np.integer[Any]],
) -> None:
    """Sort futures by cell in each step.

    Args:
        cells: (H or more, M) as in `Futures`.
        starts: (H, S + 1) integers out, as there.
        members: (H, M) integers out, as there.
    """
    for h in range(len(starts)):
        sort_by_cell(cells[h], starts[h], members[h])


@compiled()
def sample(
    mass: Mass,
    padded: GridShape,
    weights: Floats,
    count: int,
    offset: float,
    rows: Ints,
    cells: NDArray[np.integer[Any]],
) -> None:
    """Draw scenarios systematically: each cell gets its share of them, rounded up or down.

    Args:
        padded: Of the forecast.
        weights: (C,) float64, factors with which it sums to about 1.
        count: M.
        offset: In [0, 1).
        rows: (M,) int64 out, the row of the belief.
        cells: (M,) int64 out, the column.
    """
    drawn, total, last_row, last_cell = 0, 0.0, 0, 0
    components = mass.components
    drifts = len(components) // len(weights)
    for k in range(len(components)):
        for y in range(padded.rows):
            for x in range(padded.columns):
                i, at = y * padded.columns + x, place_of(mass, k, x, y)
                share = components[k, at] * weights[k // drifts] if at >= 0 else 0.0
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
def roll(
    constants: NDArray[np.void],
    sea: Sea,
    tables: MotionTables,
    slots: Ints,
    offsets: Floats,
    rows: Ints,
    futures: Futures,
) -> None:
    """Advance the persons of all futures by their steps.

    Args:
        offsets: (H,) float64 in [0, 1), offsets of the draws.
        rows: (M,) of `sample`.
        futures: The first row of their cells is in, the rest is out.
    """
    row = np.empty(ROW)
    spread = np.empty(len(rows))
    drifts = rows % tables.directions.shape[1]
    for s in range(len(rows)):
        spread[s] = s * GOLDEN - math.floor(s * GOLDEN)
    for h in range(len(slots)):
        moves, directions = tables_at(tables, slots[h]), tables.directions[slots[h]]
        now, after = futures.cells[h], futures.cells[h + 1]
        sort_by_cell(now, futures.starts[h], futures.members[h])
        seen_cell, seen_direction = -1, -1
        for s in futures.members[h]:
            i, direction = now[s], directions[drifts[s]]
            if direction == STAND_STILL:
                after[s] = i
                continue
            if i != seen_cell or direction != seen_direction:
                move_probabilities(constants[0], sea, moves, i, direction, row)
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
def expect(
    constants: NDArray[np.void],
    sea: Sea,
    mass: Mass,
    tables: MotionTables,
    slots: Ints,
    looks: LooksToCome,
    gamma: float,
    scratch: Floats,
) -> Expected:
    """Return what plans are expected to find, by the exact filter; see `TargetBelief`.

    Args:
        looks: A `LooksToCome` with PODs (Q, C) by detection class.
        scratch: Of `component_motion.predict`.
    """
    pitch, plans = pitch_of(constants[0]), len(looks.starts) - 1
    expected = Expected(np.zeros(plans), np.zeros((plans, mass.cells.shape[1])))
    for v in range(plans):
        left = Mass(
            mass.components.copy(), mass.boxes.copy(), mass.cells.copy(), mass.totals.copy()
        )  # fmt: skip
        worth, q = 1.0, looks.starts[v]
        for h in range(len(slots)):
            moves = tables_at(tables, slots[h])
            while q < looks.starts[v + 1] and looks.steps[q] == h:
                y, x = divmod(looks.columns[q], pitch)
                found = apply_failed_search(
                    constants[0], left, moves.apart, looks.pods[q], x - MARGIN, y - MARGIN
                )  # fmt: skip
                expected.finds[v] += worth * found
                q += 1
            predict(constants, sea, left, moves, scratch)
            worth *= gamma
        for m in range(len(left.cells)):
            expected.left[v] += left.cells[m]
    return expected

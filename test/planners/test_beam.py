# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The beam search of the planner `belief`, against all plans."""

from __future__ import annotations

import itertools
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from dsse_ros.planners.beam import plan_drone
from dsse_ros.planners.plan_kernels import Moves, Scenarios
from dsse_ros.search.belief.future_kernels import index
from dsse_ros.search.belief.motion_kernels import MARGIN
from dsse_ros.search.belief.protocol import Futures

GRID, HORIZON, GAMMA = 4, 2, 0.9
SIDE = GRID + 2 * MARGIN
START = SIDE * (MARGIN + 1) + MARGIN + 1
STEPS = np.array([0, -1, 1, -SIDE, SIDE])


def moves_of(rng: np.random.Generator) -> Moves:
    """Return moves that each look at their end with a POD; the last one takes longer."""
    y, x = np.indices((SIDE, SIDE)).reshape(2, -1)
    pods = rng.choice([0.5, 1.0], (len(STEPS), 1))
    return Moves(
        STEPS, np.ones(len(STEPS), np.bool_), np.arange(len(STEPS) + 1),
        np.zeros((len(STEPS), 2), np.int64), pods,
        np.ones((SIDE, SIDE)),
        y * 2 * SIDE + x, np.zeros(4 * SIDE * SIDE, np.int64),
        np.array([0.0, 0.0, 0.0, 0.0, 0.4]), np.zeros(len(STEPS)),
    )  # fmt: skip


def scenarios_of(rng: np.random.Generator, count: int) -> Scenarios:
    """Return futures of persons who jump about."""
    futures = Futures.empty(count, HORIZON, SIDE * SIDE)
    x, y = rng.integers(MARGIN, MARGIN + GRID, (2, HORIZON + 1, count))
    futures.cells[:] = SIDE * y + x
    index(futures.cells, futures.starts, futures.members)
    draws = rng.random((HORIZON, count))
    return Scenarios(
        np.zeros(count, np.int64), draws, futures.starts, futures.members, futures.cells[-1]
    )


def value_of(
    plan: tuple[int, ...], moves: Moves, scenarios: Scenarios, credit: NDArray[np.float64]
) -> float:
    """Return the discounted finds of a plan in addition to those of the others."""
    cell, late, best = START, 0.0, credit.copy()
    for h, a in enumerate(plan):
        cell, late = cell + STEPS[a], late + moves.extra[a]
        step = h + math.ceil(late)
        if step < HORIZON:
            first, last = scenarios.starts[step, cell : cell + 2]
            for s in scenarios.members[step, first:last]:
                if scenarios.draws[step, s] < moves.pods[a, 0]:
                    best[s] = max(best[s], GAMMA ** (h + late))
    return float((best - credit).sum())


@given(st.integers(0, 2**32))
def test_no_plan_finds_more_than_the_best_one_of_a_wide_beam(seed: int) -> None:
    rng = np.random.default_rng(seed)
    moves, scenarios = moves_of(rng), scenarios_of(rng, 100)
    credits = rng.choice([0.0, GAMMA, 1.0], (3, 100), p=[0.8, 0.1, 0.1])
    paths = np.full((1, HORIZON + 1), START)
    blocked = np.zeros((HORIZON, SIDE * SIDE), np.bool_)
    found, length = plan_drone(moves, scenarios, GAMMA, 0.0, 100, credits, blocked, paths)
    assert (found, length) == (1, HORIZON)
    ways = itertools.product(range(len(STEPS)), repeat=HORIZON)
    values = {plan: value_of(plan, moves, scenarios, credits.max(axis=0)) for plan in ways}
    chosen = tuple(int(np.flatnonzero(step == STEPS)[0]) for step in np.diff(paths[0]))
    assert math.isclose(values[chosen], max(values.values()), abs_tol=1e-9)

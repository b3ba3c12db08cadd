# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Path search finds what trying all paths finds, and its bounds hold."""

from __future__ import annotations

import itertools
import time
from dataclasses import replace

import numpy as np
import pytest

from dsse_ros.belief.protocol import TargetChain
from dsse_ros.planners import path_kernels
from dsse_ros.planners.path_bound import upper_bound
from dsse_ros.planners.path_problem import PathProblem, search_graph
from dsse_ros.planners.path_search import improve

COLUMNS, STEPS = 5, 4


def problem(seed: int, searchers: int, pod: float, columns: int = COLUMNS) -> PathProblem:
    """A target that moves by any matrix on a ring of columns; a searcher stays or goes around."""
    rng = np.random.default_rng(seed)
    matrix = rng.dirichlet(np.full(columns, 0.5), columns)
    layers = columns * np.arange(STEPS + 1)
    count = columns * (STEPS + 1)
    to = (np.tile(np.arange(columns), (STEPS, columns, 1)) + layers[1:, None, None]).ravel()
    chain = TargetChain(
        layers[:, None] + np.arange(columns + 1), rng.dirichlet(np.ones(columns)),
        np.zeros(count, np.int64), np.minimum(columns * np.arange(count + 1), len(to)), to,
        np.tile(matrix.ravel(), STEPS),
    )  # fmt: skip
    ring = np.arange(columns)
    ahead = np.stack([ring, (ring + 1) % columns, (ring - 1) % columns])
    graph = search_graph(ahead, np.arange(4), np.tile(ring, (3, 1)), np.full((3, 1), pod))
    starts = rng.integers(0, columns, searchers).tolist()
    return PathProblem(chain, [graph] * searchers, starts, np.ones(STEPS))


def best_of_all(of: PathProblem) -> float:
    paths = [np.array(moves) for moves in itertools.product(range(3), repeat=STEPS)]
    return max(of.value(plans) for plans in itertools.product(paths, repeat=len(of.starts)))


@pytest.mark.parametrize("pod", [0.4, 1.0])
@pytest.mark.parametrize("seed", range(5))
def test_a_single_path_is_proven_to_be_the_best_of_all(seed: int, pod: float) -> None:
    of = problem(seed, 1, pod)
    found = improve(of, [None], np.random.default_rng(0), iterations=0, width=100)
    assert found.optimal
    assert found.value == pytest.approx(best_of_all(of), abs=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_two_paths_are_the_best_of_all_and_below_the_bound(seed: int) -> None:
    of = problem(seed, 2, 0.5)
    best = best_of_all(of)
    found = improve(of, [None, None], np.random.default_rng(0), iterations=30)
    assert found.value == pytest.approx(best, abs=1e-8)
    assert best - 1e-9 <= upper_bound(of, 50, np.random.default_rng(0)) <= 1.3 * best


def test_paths_keep_apart_and_visit_no_column_twice() -> None:
    of = replace(problem(0, 2, 0.5), starts=[0, 2], apart=True)
    plans = improve(of, [None, None], np.random.default_rng(0), iterations=5).plans
    cells = [of.cells(n, plan) for n, plan in enumerate(plans)]
    assert all(a != b for a, b in zip(*cells, strict=True))
    of = replace(problem(0, 1, 0.5), starts=[0], revisits=False)
    (plan,) = improve(of, [None], np.random.default_rng(0), iterations=5).plans
    assert len({0, *of.cells(0, plan)}) == STEPS + 1


def test_the_end_of_a_path_adds_what_it_is_stated_to_add() -> None:
    line = np.arange(3)
    of = replace(
        problem(0, 2, 0.0, columns=9),
        nearness=0.2 * 0.7 ** np.add.outer(line, line),
    )
    other, *paths = (np.array(moves) for moves in itertools.product(range(3), repeat=STEPS))
    miss = of.miss([other, None])
    reach = np.empty_like(miss)
    path_kernels.forward(of.chain, miss, reach)
    ends, without = of.ends(1, [other, None], reach), of.value([other, None])
    for path in paths:
        added = of.value([other, path]) - without
        assert added == pytest.approx(ends[of.cells(1, path)[-1]], abs=1e-12)


def test_after_the_deadline_the_given_plans_stay() -> None:
    of = problem(1, 2, 0.5)
    given = [np.zeros(STEPS, np.int64)] * 2
    found = improve(
        of, given, np.random.default_rng(0), iterations=10**9, deadline_s=time.monotonic() - 1.0
    )
    assert all(np.array_equal(plan, given[0]) for plan in found.plans)
    assert found.value == pytest.approx(of.value(given))

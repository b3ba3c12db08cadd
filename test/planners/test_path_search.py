# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Path search finds what trying all paths finds, and proves a single path."""

from __future__ import annotations

import itertools
import time
from dataclasses import replace

import numpy as np
import pytest
from rings import STEPS, best_of_all, problem

from dsse_ros.planners import path_kernels
from dsse_ros.planners.path_search import improve


@pytest.mark.parametrize("pod", [0.4, 1.0])
@pytest.mark.parametrize("seed", range(5))
def test_a_single_path_is_proven_to_be_the_best_of_all(seed: int, pod: float) -> None:
    of = problem(seed, 1, pod)
    found = improve(of, [None], np.random.default_rng(0), iterations=0, width=100)
    assert found.bound == pytest.approx(found.value, abs=1e-8)
    assert found.value == pytest.approx(best_of_all(of), abs=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_two_paths_are_the_best_of_all(seed: int) -> None:
    of = problem(seed, 2, 0.5)
    found = improve(of, [None, None], np.random.default_rng(0), iterations=30)
    assert found.value == pytest.approx(best_of_all(of), abs=1e-8)


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

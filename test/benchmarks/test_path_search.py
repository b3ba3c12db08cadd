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

from benchmarks.paths import kernels
from benchmarks.paths.chain import chain_of
from benchmarks.paths.search import improve
from dsse_ros.search.belief.belief import Forecast
from dsse_ros.search.belief.motion_kernels import MARGIN
from dsse_ros.search.step.looks import Looked
from dsse_ros.world.scenario.scenario import scenario_and_rules


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
    kernels.forward(of.chain, miss, reach)
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


def test_the_chain_brings_the_person_where_the_belief_has_them() -> None:
    scenario, rules = scenario_and_rules(rules="paper", grid_size=9, sigma=2.0)
    belief = Forecast(scenario, rules, horizon=4).belief()
    belief.update([Looked((4, 4), np.array([0.7]))])
    chain, padded = chain_of(belief, 4), belief.forecast.padded
    reach = np.zeros(len(chain.persons))
    reach[: len(chain.prior)] = chain.prior
    for s in range(chain.starts[-1, 0]):
        steps = slice(chain.first[s], chain.first[s + 1])
        np.add.at(reach, chain.to[steps], reach[s] * chain.chance[steps])
    for starts in chain.starts:
        sums = np.add.reduceat(np.append(reach, 0.0), starts)[:-1] * (np.diff(starts) > 0)
        inner = sums.reshape(padded.matrix)[MARGIN:-MARGIN, MARGIN:-MARGIN]
        np.testing.assert_allclose(inner, belief.poc(), rtol=0, atol=1e-9)
        belief.advance()

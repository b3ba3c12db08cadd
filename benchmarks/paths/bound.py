# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# mypy: disable-error-code="no-untyped-def"
"""A bound on the probability of detection by any joint paths, to state how good a plan is."""

from __future__ import annotations

import math

import numpy as np

from benchmarks.paths import kernels
from benchmarks.paths.kernels import PathTask, gain_of
from benchmarks.paths.problem import PathProblem, Plan, Plans
from dsse_ros.base.compiled.jit import compiled, kernel


def upper_bound(problem: PathProblem, cuts: int, rng: np.random.Generator) -> float:
    """Return a bound on the probability of detection by any plans.

    At any plans, the probability of no detection is at least a linear function of the looks, as it
    is convex in the number of looks that a target meets. So is the mean of such functions, whose
    least value is a longest path for each searcher. The cuts are at plans drawn from these paths
    (the method of Frank and Wolfe, with whole numbers of looks).

    Args:
        problem: The search; searchers and looks are alike, and gains are 1.
        cuts: Number of linear functions.
        rng: Generator of the draws.
    """
    graph, count, steps = problem.graphs[0], len(problem.starts), len(problem.gains)
    shape = (steps, *graph.ahead.shape)
    constant, slopes, bound = 0.0, np.zeros(shape), math.inf
    plans: Plans = [None] * count
    paths: list[Plan] = []
    for k in range(cuts):
        miss, values = problem.miss(plans), np.empty(shape)
        reach, later = np.empty((2, len(miss)))
        worth = problem.worth(plans)
        kernels.forward(problem.chain, miss, reach)
        kernels.backward(problem.chain, problem.gains, worth, miss, later)
        task = PathTask(
            problem.chain, graph, problem.gains, np.empty(0), miss, later,
            np.empty((0, 0), np.bool_), np.empty((0, 0)),
        )  # fmt: skip
        look_values(task, reach, values)
        value = problem.value(plans)
        for n, plan in enumerate(plans):
            if plan is not None:
                value -= values[np.arange(steps), plan, problem.cells(n, plan)].sum()
        share = 2.0 / (k + 2)
        constant += share * (value - constant)
        slopes += share * (values - slopes)
        total = constant
        for n, start in enumerate(problem.starts):
            path = np.empty(steps, np.int64)
            total += longest(
                graph.ahead, problem.blocked_for(n, [None] * count), slopes, start, path
            )
        bound = min(bound, total)
        paths.append(path)
        plans = [paths[i] for i in rng.integers(len(paths) // 2, len(paths), count)]
    return bound


@kernel
def look_values(task, reach, values):
    """Write what the looks of each move would add.

    Args:
        task: As in `kernels`; of it, `ends`, `blocked` and `weights` are not read.
        reach: As in `kernels`.
        values: (H, A, C) float64 out, by step, move and column after it.
    """
    for h in range(len(task.gains)):
        for a in range(len(task.graph.ahead)):
            for cell in range(task.graph.ahead.shape[1]):
                values[h, a, cell] = gain_of(task, reach, h, a, cell)


@compiled()
def longest(ahead, blocked, values, start, moves):
    """Find the path with the greatest sum of values, by dynamic programming; return the sum.

    Args:
        ahead: (A, C) of `SearchGraph`.
        blocked: (H, C) bool.
        values: (H, A, C) float64.
        start: The first column.
        moves: (H,) int64 out.
    """
    steps, num_moves, columns = values.shape
    best = np.full((steps + 1, columns), -np.inf)
    chosen = np.zeros((steps, columns), np.int64)
    best[steps] = 0.0
    for h in range(steps - 1, -1, -1):
        for cell in range(columns):
            for a in range(num_moves):
                after = ahead[a, cell]
                if after < 0 or blocked[h, after]:
                    continue
                total = values[h, a, after] + best[h + 1, after]
                if total > best[h, cell]:
                    best[h, cell], chosen[h, cell] = total, a
    cell = start
    for h in range(steps):
        moves[h] = chosen[h, cell]
        cell = ahead[moves[h], cell]
    return best[0, start]

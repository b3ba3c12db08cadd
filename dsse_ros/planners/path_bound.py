# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A bound on the probability of detection by any joint paths, to state how good a plan is."""

from __future__ import annotations

import math

import numpy as np

from dsse_ros.planners import path_kernels
from dsse_ros.planners.path_kernels import PathTask
from dsse_ros.planners.path_problem import PathProblem, Plan, Plans


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
        path_kernels.forward(problem.chain, miss, reach)
        path_kernels.backward(problem.chain, problem.gains, worth, miss, later)
        task = PathTask(
            problem.chain, graph, problem.gains, np.empty(0), miss, later,
            np.empty((0, 0), np.bool_), np.empty((0, 0)),
        )  # fmt: skip
        path_kernels.look_values(task, reach, values)
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
            total += path_kernels.longest(
                graph.ahead, problem.blocked_for(n, [None] * count), slopes, start, path
            )
        bound = min(bound, total)
        paths.append(path)
        plans = [paths[i] for i in rng.integers(len(paths) // 2, len(paths), count)]
    return bound

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Searches on a ring of few columns, whose best paths follow from trying all of them."""

from __future__ import annotations

import itertools

import numpy as np

from benchmarks.paths.chain import TargetChain
from benchmarks.paths.problem import PathProblem, search_graph

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

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the optimal allocation of effort, and of its routes."""

from __future__ import annotations

from itertools import product

import numpy as np
from grid_walker import DIAGONAL, STRAIGHT
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.planners.effort_allocation import SURE_LOOK, allocate, nearest_routes
from dsse_ros.world.scenario.actions import ActionSet

small_maps = st.lists(st.floats(0, 1), min_size=4, max_size=4)


def pos(likely: list[float], searches: tuple[int, ...], pod: float) -> float:
    """Return the probability of success."""
    return sum(p * (1 - (1 - pod) ** k) for p, k in zip(likely, searches, strict=True))


@settings(deadline=None)
@given(small_maps, st.floats(0.05, 1), st.integers(1, 5))
def test_no_other_allocation_finds_with_a_greater_probability(
    likely: list[float], pod: float, effort: int
) -> None:
    allocated = allocate(np.array(likely).reshape(2, 2), [(0, 0, pod)], effort)
    ours = tuple(allocated.get((i % 2, i // 2), 0) for i in range(4))
    assert sum(ours) <= effort
    best = max(
        pos(likely, other, pod)
        for other in product(range(effort + 1), repeat=4)
        if sum(other) == effort
    )
    assert pos(likely, ours, pod) >= best - 1e-12


def test_the_whole_searches_are_near_the_continuous_optimum_of_koopman() -> None:
    pod, effort = 0.2, 4000
    likely = np.exp(-np.add.outer(*[np.linspace(-2, 2, 12) ** 2] * 2))
    likely /= likely.sum()
    alpha = -np.log(1 - pod)
    low, high = 1e-12, 1.0
    for _ in range(200):
        multiplier = np.sqrt(low * high)
        density = np.maximum(0, np.log(likely * alpha / multiplier)) / alpha
        low, high = (multiplier, high) if density.sum() > effort else (low, multiplier)
    searches = allocate(likely, [(0, 0, pod)], effort)
    whole = np.zeros_like(likely)
    for (col, row), times in searches.items():
        whole[row, col] = times
    assert np.abs(whole - density).max() <= 1.0


def test_a_certain_detection_leaves_nothing_to_search_twice() -> None:
    searches = allocate(np.array([[0.5, 0.3], [0.2, 0.0]]), SURE_LOOK, 9)
    assert searches == {(0, 0): 1, (1, 0): 1, (0, 1): 1}


@settings(deadline=None)
@given(
    st.dictionaries(st.tuples(st.integers(0, 8), st.integers(0, 8)), st.integers(1, 3)),
    st.integers(1, 4),
    st.sampled_from([STRAIGHT, DIAGONAL]),
)
def test_every_search_is_on_one_route(
    searches: dict[tuple[int, int], int], drones: int, actions: tuple[str, ...]
) -> None:
    present = [(k, 8) for k in range(drones)]
    routes = nearest_routes(present, searches, [ActionSet(actions)] * len(present))
    assert all(routes)
    planned = [
        c for route, own in zip(routes, present, strict=True) for c in route if route != [own]
    ]
    for cell, times in searches.items():
        if cell not in present:
            assert planned.count(cell) == times

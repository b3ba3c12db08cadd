# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the sector search."""

from __future__ import annotations

from itertools import islice, pairwise
from math import atan2, degrees, hypot

import numpy as np
import pytest
from grid_walker import DIAGONAL, STRAIGHT, GridWalker
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.registry import make_planner
from dsse_ros.planners.sector import sector_routes, triangles
from dsse_ros.world.scenario.actions import ActionSet

DATUM, SIZE = (80, 80), 161


def bearing(start: tuple[int, int], end: tuple[int, int]) -> float:
    """Return the direction in degrees clockwise from north."""
    return degrees(atan2(end[0] - start[0], start[1] - end[1])) % 360


def test_a_triangle_is_equilateral_and_turns_120_degrees_to_starboard() -> None:
    for triangle in islice(triangles(DATUM, GridShape.square(SIZE)), 6):
        side = (len(triangle) - 1) // 3
        # Legs have as many cells as the larger of their extents, so corners are looked for.
        far = max(hypot(c - DATUM[0], r - DATUM[1]) for c, r in triangle)
        corners = [c for c in triangle if hypot(c[0] - DATUM[0], c[1] - DATUM[1]) > far - 1.5]
        first, second = corners[0], corners[-1]
        assert triangle[0] == triangle[-1] == DATUM and side > 0
        turn = (bearing(DATUM, second) - bearing(DATUM, first)) % 360
        assert turn == pytest.approx(60, abs=3)
        assert hypot(second[0] - first[0], second[1] - first[1]) == pytest.approx(far, abs=3)


def test_the_datum_is_passed_straight_on() -> None:
    for before, after in pairwise(islice(triangles(DATUM, GridShape.square(SIZE)), 3)):
        apart = bearing(before[-10], DATUM) - bearing(DATUM, after[9])
        assert (apart + 180) % 360 - 180 == pytest.approx(0, abs=8)


def test_the_first_leg_goes_north_and_the_second_pattern_is_turned_by_30_degrees() -> None:
    first, *_, fourth = islice(triangles(DATUM, GridShape.square(SIZE)), 4)
    assert bearing(DATUM, first[20]) == pytest.approx(0, abs=2)
    assert bearing(DATUM, fourth[20]) == pytest.approx(30, abs=3)


@pytest.mark.slow
@settings(deadline=None)
@given(st.integers(1, 20), st.data(), st.integers(1, 9))
def test_routes_stay_on_the_grid_and_all_begin_at_the_datum(
    size: int, data: st.DataObject, drones: int
) -> None:
    col, row = data.draw(st.tuples(*[st.integers(0, size - 1)] * 2))
    probability = np.zeros((size, size), np.float32)
    probability[row, col] = 1
    starts = [(k % size, k // size) for k in range(min(drones, size * size))]
    routes = sector_routes(starts, probability, [ActionSet(STRAIGHT)] * len(starts))
    assert len(routes) == len(starts)
    for route in routes:
        assert route[0] == (col, row)
        assert all(0 <= c < size and 0 <= r < size for c, r in route)


@pytest.mark.parametrize("actions", [STRAIGHT, DIAGONAL])
def test_one_drone_crosses_the_datum_again_and_again(actions: tuple[str, ...]) -> None:
    probability = np.zeros((17, 17), np.float32)
    probability[8, 8] = 1
    walker = GridWalker(17, [(0, 0)], actions, probability)
    planner = make_planner("sector", actions)
    for _ in range(200):
        walker.step(planner)
    assert walker.searched[8, 8] >= 4
    assert walker.searched[8, 4] >= 1


def test_several_drones_search_different_sectors() -> None:
    probability = np.zeros((41, 41), np.float32)
    probability[20, 20] = 1
    starts = [(0, 0), (1, 0), (2, 0)]
    routes = sector_routes(starts, probability, [ActionSet(STRAIGHT)] * len(starts))
    sectors = [round(bearing((20, 20), route[7]) / 120) % 3 for route in routes]
    assert sorted(sectors) == [0, 1, 2]

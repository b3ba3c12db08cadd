# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the spiral search."""

from __future__ import annotations

from itertools import pairwise, takewhile
from math import hypot

import numpy as np
from grid_walker import STRAIGHT
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.planner import Cell
from dsse_ros.planners.spiral import arms, spiral_routes, turns
from dsse_ros.world.scenario.actions import ActionSet


def cells_of(arm: NDArray[np.int64]) -> list[Cell]:
    return [(col, row) for col, row in arm.tolist()]


@st.composite
def squares(draw: st.DrawFn) -> tuple[int, Cell]:
    """The size of a grid and a cell of it."""
    size = draw(st.integers(1, 20))
    return size, (draw(st.integers(0, size - 1)), draw(st.integers(0, size - 1)))


@settings(deadline=None)
@given(squares(), st.integers(1, 9))
def test_the_arms_have_every_cell_once(square: tuple[int, Cell], count: int) -> None:
    size, datum = square
    cells = [cell for arm in arms(datum, GridShape.square(size), count) for cell in cells_of(arm)]
    assert sorted(cells) == [(col, row) for col in range(size) for row in range(size)]


@settings(deadline=None)
@given(squares(), st.integers(1, 9))
def test_each_arm_is_that_of_its_formula_cell_by_cell(square: tuple[int, Cell], count: int) -> None:
    size, datum = square
    places: list[list[tuple[float, Cell]]] = [[] for _ in range(count)]
    for row in range(size):
        for col in range(size):
            radius, angle = hypot(col - datum[0], row - datum[1]), turns(datum, (col, row))
            winding = round(radius - count * angle)
            arm = -winding % count
            places[arm].append(((winding + arm) / count + angle, (col, row)))
    assert [cells_of(arm) for arm in arms(datum, GridShape.square(size), count)] == [
        [cell for _, cell in sorted(of_arm)] for of_arm in places
    ]


def test_an_arm_winds_outwards_clockwise_a_cell_apart() -> None:
    (arm,) = arms((20, 20), GridShape.square(41), 1)
    whole = list(takewhile(lambda cell: hypot(cell[0] - 20, cell[1] - 20) < 19, cells_of(arm)))
    assert len(whole) > 900
    assert whole[0] == (20, 20)
    radii = [hypot(col - 20, row - 20) for col, row in whole]
    assert all(later > sooner - 1.5 for sooner, later in pairwise(radii))
    assert all(hypot(b[0] - a[0], b[1] - a[1]) < 3 for a, b in pairwise(whole))
    angles = [turns((20, 20), cell) for cell in whole[20:]]
    assert all((b - a) % 1.0 < 0.5 for a, b in pairwise(angles))


@settings(deadline=None)
@given(squares(), st.integers(1, 9))
def test_each_drone_has_a_route_and_together_they_search_the_whole_grid(
    square: tuple[int, Cell], drones: int
) -> None:
    size, (col, row) = square
    probability = np.zeros((size, size), np.float32)
    probability[row, col] = 1
    starts = [(k % size, k // size) for k in range(min(drones, size * size))]
    routes = spiral_routes(starts, probability, [ActionSet(STRAIGHT)] * len(starts))
    assert all(routes)
    assert {cell for route in routes for cell in route} == {
        (c, r) for c in range(size) for r in range(size)
    }

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the expanding square search."""

from __future__ import annotations

from itertools import groupby, pairwise

import numpy as np
import pytest
from grid_walker import DIAGONAL, STRAIGHT, GridWalker
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.expanding_square import shared_square, square_routes, square_spiral
from dsse_ros.planners.planner import Cell
from dsse_ros.planners.registry import make_planner
from dsse_ros.world.scenario.actions import ActionSet

action_names = st.sampled_from([STRAIGHT, DIAGONAL])


@st.composite
def squares(draw: st.DrawFn, largest: int = 20) -> tuple[int, Cell]:
    """The size of a grid and a cell of it."""
    size = draw(st.integers(1, largest))
    return size, (draw(st.integers(0, size - 1)), draw(st.integers(0, size - 1)))


def ring(datum: Cell, cell: Cell) -> int:
    return max(abs(cell[0] - datum[0]), abs(cell[1] - datum[1]))


def test_the_legs_grow_by_one_spacing_on_every_other_turn_to_starboard() -> None:
    spiral = list(square_spiral((10, 10), GridShape.square(21)))
    steps = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(spiral)]
    legs = [(step, len(list(run))) for step, run in groupby(steps)]
    north, east, south, west = (0, -1), (1, 0), (0, 1), (-1, 0)
    assert legs[:8] == [
        *((north, 1), (east, 1), (south, 2), (west, 2)),
        *((north, 3), (east, 3), (south, 4), (west, 4)),
    ]
    assert [length for _, length in legs[:-1]] == [k // 2 + 1 for k in range(len(legs) - 1)]


@settings(deadline=None)
@given(squares())
def test_the_spiral_has_every_cell_once_from_the_datum_outwards(square: tuple[int, Cell]) -> None:
    size, datum = square
    spiral = list(square_spiral(datum, GridShape.square(size)))
    assert spiral[0] == datum
    assert sorted(spiral) == [(col, row) for col in range(size) for row in range(size)]
    rings = [ring(datum, cell) for cell in spiral]
    assert rings == sorted(rings)


@settings(deadline=None)
@given(squares())
def test_the_edge_of_the_grid_only_leaves_cells_out(square: tuple[int, Cell]) -> None:
    size, (col, row) = square
    whole = square_spiral((col + size, row + size), GridShape.square(3 * size))
    inside = [(c - size, r - size) for c, r in whole]
    inside = [(c, r) for c, r in inside if 0 <= c < size and 0 <= r < size]
    assert list(square_spiral((col, row), GridShape.square(size))) == inside


@settings(deadline=None)
@given(squares(), st.data(), action_names)
def test_the_drones_share_each_ring_in_contiguous_arcs(
    square: tuple[int, Cell], data: st.DataObject, actions: tuple[str, ...]
) -> None:
    size, datum = square
    count = data.draw(st.integers(1, size * size))
    routes = shared_square(datum, GridShape.square(size), [ActionSet(actions)] * count)
    spiral = list(square_spiral(datum, GridShape.square(size)))
    assert sorted(cell for route in routes for cell in route) == sorted(spiral)
    lengths = [len(route) for route in routes]
    assert max(lengths) - min(lengths) <= 1
    place = {cell: k for k, cell in enumerate(spiral)}
    for route in routes:
        for _, arc in groupby(route, key=lambda cell: ring(datum, cell)):
            places = sorted(place[cell] for cell in arc)
            assert places == list(range(places[0], places[-1] + 1))


@settings(deadline=None)
@given(squares(), st.integers(2, 9), action_names)
def test_several_drones_enter_each_arc_at_its_nearer_end(
    square: tuple[int, Cell], drones: int, actions: tuple[str, ...]
) -> None:
    size, datum = square
    action_set = ActionSet(actions)
    for route in shared_square(
        datum, GridShape.square(size), [action_set] * min(drones, size * size)
    ):
        arcs = [list(arc) for _, arc in groupby(route, key=lambda cell: ring(datum, cell))]
        for before, arc in pairwise(arcs):
            first, last = (action_set.distance(before[-1], arc[k]) for k in (0, -1))
            assert first <= last


@pytest.mark.slow
@settings(deadline=None)
@given(squares(largest=8), st.data(), action_names)
def test_one_drone_flies_the_exact_spiral_around_the_most_probable_cell_at_first(
    square: tuple[int, Cell], data: st.DataObject, actions: tuple[str, ...]
) -> None:
    size, datum = square
    start = data.draw(st.tuples(*[st.integers(0, size - 1)] * 2))
    probability = np.full((size, size), 0.001, np.float32)
    probability[datum[1], datum[0]] = 0.5
    walker = GridWalker(size, [start], actions, probability)
    planner = make_planner("expanding_square", actions)
    visited = []
    while not walker.covered:
        before = walker.cells["drone0"]
        action = walker.step(planner)["drone0"]
        if actions[action] == "search":
            visited.append(before)
        walker.probability = walker.probability[::-1]
    assert visited == list(square_spiral(datum, GridShape.square(size)))


@pytest.mark.parametrize("actions", [STRAIGHT, DIAGONAL])
def test_drones_take_the_side_of_the_datum_on_which_they_are(actions: tuple[str, ...]) -> None:
    probability = np.zeros((41, 41), np.float32)
    probability[20, 20] = 1
    south, west, north, east = (20, 40), (0, 20), (20, 0), (40, 20)
    routes = square_routes([south, west, north, east], probability, [ActionSet(actions)] * 4)
    side = [{(np.sign(c - 20), np.sign(r - 20)) for c, r in route[10:]} for route in routes]
    assert (0, 1) in side[0] and (0, -1) not in side[0]
    assert (-1, 0) in side[1] and (1, 0) not in side[1]
    assert (0, -1) in side[2] and (0, 1) not in side[2]
    assert (1, 0) in side[3] and (-1, 0) not in side[3]


def test_an_unknown_probability_is_never_the_datum() -> None:
    probability = np.full((3, 3), np.nan, np.float32)
    probability[1, 2] = 0.1
    (route,) = square_routes([(0, 0)], probability, [ActionSet(STRAIGHT)])
    assert route[0] == (2, 1)

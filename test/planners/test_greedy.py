# SPDX-License-Identifier: Apache-2.0
"""Promises of the published greedy policy."""

from __future__ import annotations

import numpy as np
import pytest
from grid_walker import DIAGONAL, STRAIGHT, GridWalker
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.planners import make_planner
from dsse_ros.planners.greedy import most_probable
from dsse_ros.planners.planner import Cell


@settings(deadline=None)
@given(st.data())
def test_the_most_probable_cells_are_the_end_of_a_stable_sort(data: st.DataObject) -> None:
    size = data.draw(st.integers(1, 12))
    count = data.draw(st.integers(1, size * size))
    values = st.sampled_from([0.0, 0.125, 0.25, 0.5])
    drawn = data.draw(st.lists(values, min_size=size * size, max_size=size * size))
    probability = np.array(drawn, np.float32).reshape(size, size)
    ordered = sorted(
        ((col, row) for row in range(size) for col in range(size)),
        key=lambda cell: probability[cell[1], cell[0]],
    )
    assert most_probable(probability, count) == ordered[-count:]


def test_an_unknown_probability_is_the_worst() -> None:
    probability = np.array([[np.nan, 0.1], [0.3, np.nan]], np.float32)
    assert most_probable(probability, 2) == [(1, 0), (0, 1)]
    assert most_probable(probability, 4)[2:] == [(1, 0), (0, 1)]


def greedy_actions(
    cells: list[Cell], values: dict[Cell, float], actions: tuple[str, ...] = DIAGONAL
) -> list[str]:
    """Return the names of the actions on a 9 x 9 map that is zero but for these cells."""
    probability = np.zeros((9, 9), np.float32)
    for (col, row), value in values.items():
        probability[row, col] = value
    walker = GridWalker(9, cells, actions, probability)
    return [actions[k] for k in walker.step(make_planner("greedy", actions)).values()]


@pytest.mark.parametrize(
    ("cell", "with_diagonals", "without"),
    [
        ((0, 0), "down_right", "right"),
        ((8, 2), "down_left", "left"),
        ((3, 8), "up_right", "up"),
        ((8, 8), "up_left", "left"),
        ((4, 7), "up", "up"),
        ((4, 4), "search", "search"),
    ],
)
def test_a_drone_moves_towards_its_cell_and_searches_when_there(
    cell: Cell, with_diagonals: str, without: str
) -> None:
    assert greedy_actions([cell], {(4, 4): 1}) == [with_diagonals]
    assert greedy_actions([cell], {(4, 4): 1}, STRAIGHT) == [without]


def test_the_last_drone_gets_the_most_probable_cell() -> None:
    values = {(0, 4): 0.2, (8, 4): 0.8}
    assert greedy_actions([(3, 4), (5, 4)], values) == ["left", "right"]
    values = {(0, 4): 0.8, (8, 4): 0.2}
    assert greedy_actions([(5, 4), (3, 4)], values) == ["right", "left"]


def test_a_drone_searches_when_its_next_cell_is_anothers_present_cell() -> None:
    values = {(8, 4): 0.3, (8, 5): 0.4}
    assert greedy_actions([(3, 4), (4, 4)], values, STRAIGHT) == ["search", "right"]
    values = {(0, 4): 0.3, (8, 4): 0.4}
    assert greedy_actions([(4, 4), (3, 4)], values) == ["search", "search"]


def test_a_drone_searches_when_its_next_cell_was_already_chosen() -> None:
    values = {(5, 4): 0.3, (3, 4): 0.4}
    assert greedy_actions([(3, 4), (5, 4)], values) == ["right", "search"]


def test_a_lost_drone_leaves_its_rank_to_the_next() -> None:
    probability = np.zeros((9, 9), np.float32)
    probability[4, 0] = 1
    walker = GridWalker(9, [(8, 0), (3, 4), (5, 4)], STRAIGHT, probability)
    walker.lose(["drone0", "drone2"])
    assert walker.step(make_planner("greedy", STRAIGHT)) == {"drone1": STRAIGHT.index("left")}

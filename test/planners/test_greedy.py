# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the published greedy policy."""

from __future__ import annotations

import numpy as np
import pytest
from grid_walker import DIAGONAL, STRAIGHT, GridWalker

from dsse_ros.planners.planner import Cell
from dsse_ros.planners.registry import make_planner


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

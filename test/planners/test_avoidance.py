# SPDX-License-Identifier: Apache-2.0
"""Promises of the collision avoidance."""

from __future__ import annotations

import pytest
from grid_walker import DIAGONAL, STRAIGHT
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.planners.avoidance import settle, settle_around
from dsse_ros.planners.planner import Cell
from dsse_ros.search import ActionSet


@st.composite
def crowds(draw: st.DrawFn) -> tuple[list[Cell], list[Cell], list[list[Cell]]]:
    """Drones in different cells, the neighbour or own cell each wishes for, and its neighbours."""
    size = draw(st.integers(1, 6))
    legend = ActionSet(draw(st.sampled_from([STRAIGHT, DIAGONAL])))
    every = [(col, row) for col in range(size) for row in range(size)]
    present = draw(st.lists(st.sampled_from(every), unique=True, min_size=1))
    around = [legend.neighbours(cell, size) for cell in present]
    wishes = [
        draw(st.sampled_from([cell, *near])) for cell, near in zip(present, around, strict=True)
    ]
    return present, wishes, around


@settings(deadline=None)
@given(crowds())
def test_two_drones_never_get_one_cell(
    crowd: tuple[list[Cell], list[Cell], list[list[Cell]]],
) -> None:
    present, wishes, _ = crowd
    granted = settle(present, wishes)
    assert len(set(granted)) == len(granted)


@settings(deadline=None)
@given(crowds())
def test_a_drone_is_held_back_only_from_a_cell_that_another_gets(
    crowd: tuple[list[Cell], list[Cell], list[list[Cell]]],
) -> None:
    present, wishes, _ = crowd
    granted = settle(present, wishes)
    for cell, wish, end in zip(present, wishes, granted, strict=True):
        assert end == wish or (end == cell and wish in granted)


@pytest.mark.parametrize(
    ("present", "wishes", "granted"),
    [
        pytest.param([(0, 0), (1, 0)], [(1, 0), (0, 0)], [(1, 0), (0, 0)], id="swap"),
        pytest.param([(0, 0), (1, 0)], [(1, 0), (2, 0)], [(1, 0), (2, 0)], id="follow"),
        pytest.param([(0, 0), (2, 0)], [(1, 0), (1, 0)], [(1, 0), (2, 0)], id="first wins"),
        pytest.param([(0, 0), (1, 0)], [(1, 0), (1, 0)], [(0, 0), (1, 0)], id="stayer wins"),
        pytest.param(
            [(0, 0), (1, 0), (2, 0)],
            [(1, 0), (2, 0), (2, 0)],
            [(0, 0), (1, 0), (2, 0)],
            id="a queue stops behind one that stays",
        ),
        pytest.param(
            [(0, 0), (1, 0), (1, 1), (0, 1)],
            [(1, 0), (1, 1), (0, 1), (0, 0)],
            [(1, 0), (1, 1), (0, 1), (0, 0)],
            id="a ring turns",
        ),
    ],
)
def test_drones_move_at_the_same_time(
    present: list[Cell], wishes: list[Cell], granted: list[Cell]
) -> None:
    assert settle(present, wishes) == granted


@settings(deadline=None)
@given(crowds(), st.data())
def test_making_room_never_ends_in_one_cell(
    crowd: tuple[list[Cell], list[Cell], list[list[Cell]]], data: st.DataObject
) -> None:
    present, wishes, around = crowd
    yielding = data.draw(st.sets(st.integers(0, len(present) - 1)))
    asked = [None if drone in yielding else wish for drone, wish in enumerate(wishes)]
    granted = settle_around(present, asked, {drone: around[drone] for drone in yielding})
    assert len(set(granted)) == len(granted)
    for drone, end in enumerate(granted):
        assert end in (
            [*around[drone], present[drone]]
            if drone in yielding
            else [wishes[drone], present[drone]]
        )
        if drone in yielding and end == present[drone]:
            assert all(cell in granted for cell in around[drone])


def test_a_drone_that_makes_room_leaves_the_cell_that_another_wants() -> None:
    assert settle_around([(0, 0), (1, 0)], [(1, 0), None], {1: [(2, 0)]}) == [(1, 0), (2, 0)]


def test_a_drone_without_a_way_out_keeps_its_cell_and_holds_up_the_queue() -> None:
    present = [(2, 0), (1, 0), (0, 0)]
    wishes = [(1, 0), (0, 0), None]
    assert settle_around(present, wishes, {2: []}) == present


def test_a_drone_that_makes_room_takes_another_exit_when_the_next_has_no_choice() -> None:
    present = [(0, 1), (1, 0)]
    exits = {0: [(1, 1), (0, 2)], 1: [(1, 1)]}
    assert settle_around(present, [None, None], exits) == [(0, 2), (1, 1)]


def test_drones_that_already_share_a_cell_are_let_apart() -> None:
    assert settle([(0, 0), (0, 0)], [(0, 0), (1, 0)]) == [(0, 0), (1, 0)]
    assert settle([(0, 0), (0, 0)], [(0, 0), (0, 0)]) == [(0, 0), (0, 0)]
    assert settle_around([(0, 0)] * 3, [(0, 0), (0, 0), None], {2: []}) == [(0, 0)] * 3

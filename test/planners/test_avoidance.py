# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the collision avoidance."""

from __future__ import annotations

import pytest
from grid_walker import DIAGONAL, STRAIGHT
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.avoidance import resolve_conflicts, resolve_conflicts_with_yielding
from dsse_ros.planners.planner import Cell
from dsse_ros.world.scenario.actions import ActionSet


@st.composite
def requests_of_drones(draw: st.DrawFn) -> tuple[list[Cell], list[Cell], list[list[Cell]]]:
    """Drones in different cells, the neighbour or own cell each requests, and its neighbours."""
    size = draw(st.integers(1, 6))
    action_set = ActionSet(draw(st.sampled_from([STRAIGHT, DIAGONAL])))
    every = [(col, row) for col in range(size) for row in range(size)]
    present = draw(st.lists(st.sampled_from(every), unique=True, min_size=1))
    around = [action_set.neighbours(cell, GridShape.square(size)) for cell in present]
    requested = [
        draw(st.sampled_from([cell, *near])) for cell, near in zip(present, around, strict=True)
    ]
    return present, requested, around


@pytest.mark.slow
@settings(deadline=None)
@given(requests_of_drones())
def test_two_drones_never_get_one_cell(
    drones: tuple[list[Cell], list[Cell], list[list[Cell]]],
) -> None:
    present, requested, _ = drones
    granted = resolve_conflicts(present, requested)
    assert len(set(granted)) == len(granted)


@settings(deadline=None)
@given(requests_of_drones())
def test_a_drone_is_held_back_only_from_a_cell_that_another_gets(
    drones: tuple[list[Cell], list[Cell], list[list[Cell]]],
) -> None:
    present, requested, _ = drones
    granted = resolve_conflicts(present, requested)
    for cell, request, end in zip(present, requested, granted, strict=True):
        assert end == request or (end == cell and request in granted)


@pytest.mark.parametrize(
    ("present", "requested", "granted"),
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
    present: list[Cell], requested: list[Cell], granted: list[Cell]
) -> None:
    assert resolve_conflicts(present, requested) == granted


@pytest.mark.slow
@settings(deadline=None)
@given(requests_of_drones(), st.data())
def test_making_room_never_ends_in_one_cell(
    drones: tuple[list[Cell], list[Cell], list[list[Cell]]], data: st.DataObject
) -> None:
    present, requested, around = drones
    yielding = data.draw(st.sets(st.integers(0, len(present) - 1)))
    asked = [None if drone in yielding else request for drone, request in enumerate(requested)]
    granted = resolve_conflicts_with_yielding(
        present, asked, {drone: around[drone] for drone in yielding}
    )
    assert len(set(granted)) == len(granted)
    for drone, end in enumerate(granted):
        assert end in (
            [*around[drone], present[drone]]
            if drone in yielding
            else [requested[drone], present[drone]]
        )
        if drone in yielding and end == present[drone]:
            assert all(cell in granted for cell in around[drone])


def test_a_drone_that_makes_room_leaves_the_cell_that_another_wants() -> None:
    assert resolve_conflicts_with_yielding([(0, 0), (1, 0)], [(1, 0), None], {1: [(2, 0)]}) == [
        (1, 0),
        (2, 0),
    ]


def test_a_drone_without_a_way_out_keeps_its_cell_and_holds_up_the_queue() -> None:
    present = [(2, 0), (1, 0), (0, 0)]
    requested = [(1, 0), (0, 0), None]
    assert resolve_conflicts_with_yielding(present, requested, {2: []}) == present


def test_a_drone_that_makes_room_takes_another_exit_when_the_next_has_no_choice() -> None:
    present = [(0, 1), (1, 0)]
    exits = {0: [(1, 1), (0, 2)], 1: [(1, 1)]}
    assert resolve_conflicts_with_yielding(present, [None, None], exits) == [(0, 2), (1, 1)]


def test_drones_that_already_share_a_cell_are_let_apart() -> None:
    assert resolve_conflicts([(0, 0), (0, 0)], [(0, 0), (1, 0)]) == [(0, 0), (1, 0)]
    assert resolve_conflicts([(0, 0), (0, 0)], [(0, 0), (0, 0)]) == [(0, 0), (0, 0)]
    assert (
        resolve_conflicts_with_yielding([(0, 0)] * 3, [(0, 0), (0, 0), None], {2: []})
        == [(0, 0)] * 3
    )

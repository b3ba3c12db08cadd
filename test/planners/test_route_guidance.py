# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of route following, from any start."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from grid_walker import DIAGONAL, STRAIGHT, GridWalker
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.planners.planner import Cell
from dsse_ros.planners.registry import make_planner
from dsse_ros.planners.route_guidance import MAX_WAIT, RoutePlanner
from dsse_ros.world.scenario.swarm import Swarm

action_names = st.sampled_from([STRAIGHT, DIAGONAL])


@pytest.mark.slow
@settings(deadline=None, max_examples=200)
@given(st.data(), st.sampled_from(["sweep", "expanding_square"]), action_names)
def test_from_any_start_the_whole_grid_is_searched(
    data: st.DataObject, name: str, actions: tuple[str, ...]
) -> None:
    size = data.draw(st.integers(1, 12))
    cells = size * size
    starts = data.draw(
        st.lists(st.integers(0, cells - 1), unique=True, min_size=1, max_size=max(1, cells // 2))
    )
    walker = GridWalker(size, [(k % size, k // size) for k in starts], actions)
    planner = make_planner(name, actions, seed=data.draw(st.integers(0, 9)))
    longest = -(-size // len(starts)) * size
    walker.cover(planner, limit=3 * longest + 30 * size + 30)


def fixed_routes(*routes: Sequence[Cell]) -> RoutePlanner:
    return RoutePlanner(lambda cells, probability, actions: routes, Swarm.alike(STRAIGHT))


def test_a_drone_that_stays_is_flown_around() -> None:
    planner = fixed_routes([(1, 1)], [(0, 1), (2, 1)])
    walker = GridWalker(3, [(1, 1), (0, 1)])
    for _ in range(60):
        walker.step(planner)
    assert min(walker.searched[0, 1], walker.searched[2, 1]) >= 4
    assert walker.searched[1, 1] >= 40


def test_a_blocked_drone_waits_with_a_search_and_then_steps_aside() -> None:
    planner = fixed_routes([(1, 0)], [(0, 0), (2, 0)])
    walker = GridWalker(3, [(1, 0), (0, 0)])
    while walker.searched[2, 0] == 0:
        walker.step(planner)
    names = []
    while walker.cells["drone1"][1] == 0:
        names.append(STRAIGHT[walker.step(planner)["drone1"]])
    assert names[-MAX_WAIT - 1 :] == [*["search"] * MAX_WAIT, "down"]


def test_a_drone_that_is_through_waits_for_the_others_without_searching() -> None:
    planner = fixed_routes([(0, 0), (0, 1)], [(2, row) for row in range(5)])
    walker = GridWalker(5, [(0, 0), (2, 0)])
    for _ in range(9):
        walker.step(planner)
    assert set(walker.searched.values()) == {1}
    assert len(walker.searched) == 7
    for _ in range(4):
        walker.step(planner)
    assert walker.searched[0, 0] + walker.searched[0, 1] > 2


@pytest.mark.parametrize("name", ["sweep", "expanding_square"])
def test_an_agent_that_was_not_there_before_is_given_a_route(name: str) -> None:
    walker = GridWalker(6, [(0, 0), (5, 5)])
    late = walker.cells.pop("drone1")
    planner = make_planner(name, STRAIGHT)
    for _ in range(5):
        walker.step(planner)
    walker.cells["drone1"] = late
    walker.cover(planner, limit=120)

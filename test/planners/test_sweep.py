# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Promises of the parallel sweep."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest
from grid_walker import DIAGONAL, STRAIGHT, GridWalker, default_start
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.planners.registry import load_planner, make_planner
from dsse_ros.planners.sweep import boustrophedon, shares, sweep_routes
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.actions import ActionSet
from dsse_ros.world.scenario.definition import SearchDefinition

action_names = st.sampled_from([STRAIGHT, DIAGONAL])


@st.composite
def fleets(draw: st.DrawFn) -> tuple[int, int]:
    """The size of a grid and a number of drones that fits."""
    size = draw(st.integers(1, 20))
    return size, draw(st.integers(1, size * size))


@settings(deadline=None)
@given(fleets())
def test_the_shares_have_every_cell_once(fleet: tuple[int, int]) -> None:
    size, count = fleet
    blocks = shares(GridShape.square(size), count)
    assert len(blocks) == count
    cells = Counter(cell for block in blocks for cell in boustrophedon(*block))
    assert len(cells) == size * size and set(cells.values()) == {1}


@settings(deadline=None)
@given(fleets())
def test_strips_and_bands_are_balanced(fleet: tuple[int, int]) -> None:
    size, count = fleet
    blocks = shares(GridShape.square(size), count)
    if count <= size:
        widths = {len(cols) for cols, _ in blocks}
        assert max(widths) - min(widths) <= 1
        assert {len(rows) for _, rows in blocks} == {size}
    else:
        assert {len(cols) for cols, _ in blocks} == {1}
        per_column = Counter(cols[0] for cols, _ in blocks)
        assert max(per_column.values()) - min(per_column.values()) <= 1


def test_lanes_are_flown_alternately_down_and_up() -> None:
    assert boustrophedon(range(2, 4), range(3)) == [(2, 0), (2, 1), (2, 2), (3, 2), (3, 1), (3, 0)]


@settings(deadline=None)
@given(fleets(), st.data())
def test_a_share_is_entered_at_its_nearest_corner(
    fleet: tuple[int, int], data: st.DataObject
) -> None:
    size, count = fleet[0], min(fleet)
    every = st.integers(0, size * size - 1)
    starts = data.draw(st.lists(every, unique=True, min_size=count, max_size=count))
    cells = [(k % size, k // size) for k in starts]
    walker = GridWalker(size, cells)
    action_set = ActionSet(STRAIGHT)
    routes = sweep_routes(cells, walker.probability, [action_set] * len(cells))
    for cell, route in zip(cells, routes, strict=True):
        cols, rows = zip(*route, strict=True)
        corners = [(c, r) for c in (min(cols), max(cols)) for r in (min(rows), max(rows))]
        assert route[0] in corners
        way = action_set.distance(cell, route[0])
        assert way == min(action_set.distance(cell, corner) for corner in corners)


@pytest.mark.slow
@settings(deadline=None)
@given(fleets(), action_names)
def test_from_the_default_start_no_cell_is_searched_twice_before_all_were_once(
    fleet: tuple[int, int], actions: tuple[str, ...]
) -> None:
    size, count = fleet
    walker = GridWalker(size, default_start(size, count), actions)
    widest = max(len(cols) * len(rows) for cols, rows in shares(GridShape.square(size), count))
    walker.cover(make_planner("sweep", actions), limit=size + 2 * widest)
    assert set(walker.searched.values()) == {1}


@settings(deadline=None)
@given(st.integers(1, 8), action_names)
def test_a_drone_searches_on_arrival_and_flies_the_finished_share_backwards(
    size: int, actions: tuple[str, ...]
) -> None:
    walker = GridWalker(size, [(0, 0)], actions)
    planner = make_planner("sweep", actions)
    visited = []
    for _ in range(4 * size * size - 2):
        before = walker.cells["drone0"]
        action = walker.step(planner)["drone0"]
        if actions[action] == "search":
            visited.append(before)
    there = boustrophedon(range(size), range(size))
    expected = [*there, *(there[-2::-1] or there), *(there[1:] or there)]
    assert visited == expected[: len(visited)]
    assert len(visited) >= 2 * size * size - 1


@pytest.mark.slow
@settings(deadline=None)
@given(st.data(), action_names)
def test_when_drones_are_lost_the_others_search_their_own_shares(
    data: st.DataObject, actions: tuple[str, ...]
) -> None:
    size = data.draw(st.integers(2, 12))
    count = data.draw(st.integers(2, size * size // 2))
    starts = default_start(size, count)
    walker = GridWalker(size, starts, actions)
    planner = make_planner("sweep", actions)
    routes = sweep_routes(starts, walker.probability, [ActionSet(actions)] * len(starts))
    for _ in range(data.draw(st.integers(1, size))):
        walker.step(planner)
    gone = data.draw(st.sets(st.integers(0, count - 1), min_size=1, max_size=count - 1))
    walker.lose(f"drone{i}" for i in gone)
    for _ in range(2 * size + 2 * max(map(len, routes))):
        walker.step(planner)
    kept = [cell for i, route in enumerate(routes) if i not in gone for cell in route]
    assert all(cell in walker.searched for cell in kept)


@pytest.mark.parametrize("actions", [STRAIGHT, DIAGONAL])
def test_with_the_last_slow_drone_lost_the_others_stop_waiting(actions: tuple[str, ...]) -> None:
    walker = GridWalker(5, default_start(5, 4), actions)  # three narrow strips, the last is wide
    planner = make_planner("sweep", actions)
    while len(walker.searched) < 15 + 4:
        walker.step(planner)
    walker.lose(["drone3"])
    seen = walker.searched.total()
    for _ in range(10):
        walker.step(planner)
    assert walker.searched.total() > seen + 3


def test_drones_that_look_in_passing_fly_their_lanes_without_a_stop() -> None:
    fields: dict[str, Any] = {"grid_size": 8, "probability_of_detection": 0.0, "timestep_limit": 90}
    env = parallel_env(rules="v2", sensor="flown_over", **fields)
    planner = load_planner("sweep")(SearchDefinition(env.rules, env.scenario), seed=0)
    observations, infos = env.reset(seed=1)
    seen: list[tuple[int, int]] = []
    for _ in range(8 * 8 - 1):
        actions = planner(observations, infos)
        assert actions["drone0"] != env.rules.action_set.search
        observations, _, _, _, infos = env.step(actions)
        seen.append(tuple(observations["drone0"][0].tolist()))
    # All cells but the one in which it starts.
    assert len(set(seen)) == len(seen) == 8 * 8 - 1

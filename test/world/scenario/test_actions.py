# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Actions by number: one place knows their moves and which one searches."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from play import cells

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.search.environments.agents import Observation
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.actions import ACTION_VECTORS, ActionSet, Cell, connected_components
from dsse_ros.world.scenario.rules import PROFILES
from dsse_ros.world.searchers.searcher import Searcher

STRAIGHT = ("left", "right", "up", "down", "search")
orders = st.permutations(list(ACTION_VECTORS))


@given(orders, st.integers(2, 9), st.data())
def test_the_way_to_a_cell_is_as_long_as_its_distance(
    names: list[str], size: int, data: st.DataObject
) -> None:
    actions = ActionSet(names)
    here, goal = data.draw(cells(GridShape.square(size))), data.draw(cells(GridShape.square(size)))
    for left in range(actions.distance(here, goal), 0, -1):
        step = actions.towards(here, goal)
        assert step in actions.neighbours(here, GridShape.square(size))
        dx, dy = actions.moves[actions.action(here, step)]
        here = (here[0] + dx, here[1] + dy)
        assert actions.distance(here, goal) == left - 1
    assert here == goal and actions.action(here, goal) == names.index("search") == actions.search


def test_without_all_four_diagonals_none_is_flown() -> None:
    assert ActionSet(ACTION_VECTORS).diagonal
    fewer = ActionSet([name for name in ACTION_VECTORS if name != "up_left"])
    assert not fewer.diagonal
    assert len(fewer.neighbours((2, 2), GridShape.square(5))) == 4


def test_what_cannot_be_searched_or_crossed_is_refused() -> None:
    with pytest.raises(ValueError, match="^actions: search missing in"):
        ActionSet(("left", "right"))
    ActionSet(("left", "search"))
    with pytest.raises(ValueError, match="^actions: right, up, down missing in"):
        ActionSet(("left", "search")).with_moves()


def test_an_unknown_action_stays_in_its_cell_and_is_never_chosen() -> None:
    actions = ActionSet(("hover", *STRAIGHT))
    assert actions.moves[0] == (0, 0) and actions.search == 5
    assert actions.action((1, 1), (1, 1)) == 5
    assert str(actions).startswith("0 hover, 1 left")


@pytest.mark.parametrize("rules", [name for name, of in PROFILES.items() if of.actions])
def test_an_observation_has_names_and_is_still_a_pair(rules: str) -> None:
    env = parallel_env(rules=rules, num_drones=3)
    observations, _ = env.reset(seed=1)
    stepped, *_ = env.step(dict.fromkeys(env.agents, env.rules.action_set.search))
    for of_all in (observations, stepped):
        for agent, observation in of_all.items():
            position, probability = observation
            named = Observation(*observation)
            assert named.position is position and named.probability is probability
            assert observation == (position, probability)
            assert env.observation_space(agent).contains(observation)


@st.composite
def kinds_in_areas(draw: st.DrawFn) -> tuple[ActionSet, Searcher, ActionSet, int]:
    """Return the actions of the rules in an area, a kind, its actions, and the grid's size."""
    size = draw(st.integers(2, 6))
    mask = np.array(draw(st.lists(st.booleans(), min_size=size**2, max_size=size**2)))
    area = mask.reshape(size, size) if draw(st.booleans()) and mask.any() else None
    names = draw(st.sampled_from([STRAIGHT, tuple(ACTION_VECTORS)]))
    moves = [name for name in names if name != "search"]
    kind = Searcher(doc="any", moves=tuple(draw(st.lists(st.sampled_from(moves), unique=True))))
    actions = ActionSet(names, area)
    return actions, kind, actions.of_kind(kind, GridShape.square(size)), size


def moves_of(actions: ActionSet, kind: Searcher, size: int, cell: Cell) -> set[Cell]:
    """Return the cells one move of a kind away, by its names alone."""
    col, row = cell
    ends = {(col + dx, row + dy) for name, (dx, dy) in ACTION_VECTORS.items() if kind.can_do(name)
            and name in actions.names}  # fmt: skip
    inside = {(x, y) for x, y in ends if 0 <= x < size and 0 <= y < size} - {cell}
    return {(x, y) for x, y in inside if actions.area is None or actions.area[y, x]}


@given(kinds_in_areas(), st.data())
def test_a_kind_flies_by_the_moves_that_it_has(
    made: tuple[ActionSet, Searcher, ActionSet, int], data: st.DataObject
) -> None:
    actions, kind, able, size = made
    inside = [
        (x, y) for y in range(size) for x in range(size)
        if actions.area is None or actions.area[y, x]
    ]  # fmt: skip
    start, goal = data.draw(st.sampled_from(inside)), data.draw(st.sampled_from(inside))
    ahead = moves_of(actions, kind, size, start)
    ends = able.ends([start] * len(able), range(len(able)))
    assert {end for end, can in zip(ends, able.able, strict=True) if can} >= ahead | {start}
    assert set(able.neighbours(start, GridShape.square(size))) <= ahead
    # Routes may leave out single diagonal moves; breadth first over those that they use.
    steps, reached = {start: 0}, [start]
    for cell in reached:
        for neighbour in able.neighbours(cell, GridShape.square(size)):
            if neighbour not in steps:
                steps[neighbour] = steps[cell] + 1
                reached.append(neighbour)
    assert able.distance(start, goal) == steps.get(goal, -1)
    distances = able.distances(start, GridShape.square(size))
    assert all(distances[y, x] == steps.get((x, y), -1) for x, y in inside)
    reachable = able.reachable(start)
    assert reachable is None or {(x, y) for x, y in inside if reachable[y, x]} == set(steps)
    here = start
    for left in range(steps.get(goal, 0), 0, -1):
        here = able.towards(here, goal)
        assert here in steps
        assert able.distance(here, goal) == left - 1
    assert here == (goal if goal in steps else start)


def test_a_kind_that_can_do_all_has_the_actions_of_the_rules() -> None:
    actions = ActionSet(ACTION_VECTORS)
    assert actions.of_kind(Searcher(doc="any"), GridShape.square(5)) is actions
    assert (
        actions.of_kind(Searcher(doc="any", moves=tuple(ACTION_VECTORS)), GridShape.square(5))
        is actions
    )


@given(kinds_in_areas(), st.data())
def test_drones_are_grouped_by_the_cells_that_they_can_reach(
    made: tuple[ActionSet, Searcher, ActionSet, int], data: st.DataObject
) -> None:
    actions, _, able, size = made
    swarm = data.draw(st.lists(st.sampled_from([actions, able]), min_size=1, max_size=4))
    at = data.draw(
        st.lists(cells(GridShape.square(size)), min_size=len(swarm), max_size=len(swarm))
    )
    components = connected_components(swarm, at)
    assert sorted(drone for drones, _ in components for drone in drones) == [*range(len(swarm))]
    for drones, component in components:
        for drone in drones:
            reachable = swarm[drone].reachable(at[drone])
            if component is None:
                assert reachable is None
            else:
                assert reachable is not None and np.array_equal(reachable, component)
                assert len(drones) == 1 or component[at[drone][1], at[drone][0]]

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Actions by number: one place knows their moves, their masks and which one searches."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from play import cells

from dsse_ros.search import ACTION_VECTORS, PROFILES, ActionSet, Observation, parallel_env

STRAIGHT = ("left", "right", "up", "down", "search")
orders = st.permutations(list(ACTION_VECTORS))


@given(orders, st.integers(1, 6), st.data())
def test_a_mask_allows_the_moves_that_stay_on_the_grid(
    names: list[str], size: int, data: st.DataObject
) -> None:
    actions = ActionSet(names)
    col, row = data.draw(cells(size))
    mask = actions.masks(size)[row][col]
    for name, (dx, dy), free in zip(actions.names, actions.moves, mask.tolist(), strict=True):
        assert (dx, dy) == ACTION_VECTORS[name]
        assert free == (0 <= col + dx < size and 0 <= row + dy < size)


@given(orders, st.integers(2, 9), st.data())
def test_the_way_to_a_cell_is_as_long_as_its_distance(
    names: list[str], size: int, data: st.DataObject
) -> None:
    actions = ActionSet(names)
    here, goal = data.draw(cells(size)), data.draw(cells(size))
    for left in range(actions.distance(here, goal), 0, -1):
        step = actions.towards(here, goal)
        assert step in actions.neighbours(here, size)
        dx, dy = actions.moves[actions.action(here, step)]
        here = (here[0] + dx, here[1] + dy)
        assert actions.distance(here, goal) == left - 1
    assert here == goal and actions.action(here, goal) == names.index("search") == actions.search


def test_without_all_four_diagonals_none_is_flown() -> None:
    assert ActionSet(ACTION_VECTORS).diagonal
    fewer = ActionSet([name for name in ACTION_VECTORS if name != "up_left"])
    assert not fewer.diagonal
    assert len(fewer.neighbours((2, 2), 5)) == 4


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
    assert actions.masks(1)[0][0].tolist() == [1, 0, 0, 0, 0, 1]
    assert str(actions).startswith("0 hover, 1 left")


@pytest.mark.parametrize("rules", PROFILES)
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

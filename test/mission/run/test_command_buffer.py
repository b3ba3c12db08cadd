# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The barrier without ROS: a buffer of commands against a plain account of what it promises."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.base.grid_shape import GridShape
from dsse_ros.mission.run.command_buffer import CommandBuffer
from dsse_ros.mission.run.mission_space import CellMissionSpace
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.world.scenario.actions import ACTION_VECTORS, ActionSet
from dsse_ros.world.scenario.swarm import Swarm
from dsse_ros.world.searchers.searcher import Searcher

ACTIONS = ("left", "right", "up", "down", "search")
SWARM = Swarm.alike(ACTIONS)
SEARCH = ACTIONS.index("search")
GRID = 6

cells = st.tuples(st.integers(0, GRID - 1), st.integers(0, GRID - 1))
commands = st.tuples(
    st.integers(0, 3),
    st.one_of(st.integers(0, len(ACTIONS) - 1), cells),
)


def buffer_of(swarm: Swarm, num_drones: int) -> CommandBuffer:
    space = CellMissionSpace(parallel_env(num_drones=num_drones, grid_size=GRID))
    space.swarm = swarm
    return CommandBuffer(space)


def give(buffer: CommandBuffer, drone: int, command: int | tuple[int, int]) -> None:
    if isinstance(command, int):
        buffer.set_action(drone, command)
    else:
        buffer.set_goal(drone, command)


def moved(cell: tuple[int, int], action: int) -> tuple[int, int]:
    dx, dy = ACTION_VECTORS[ACTIONS[action]] if action >= 0 else (0, 0)
    return cell[0] + dx, cell[1] + dy


@given(st.lists(commands), st.lists(cells, min_size=4, max_size=4))
def test_the_last_command_of_each_drone_counts(
    given_commands: list[tuple[int, int | tuple[int, int]]], places: list[tuple[int, int]]
) -> None:
    every, last = buffer_of(SWARM, 4), buffer_of(SWARM, 4)
    for drone, command in given_commands:
        give(every, drone, command)
    for drone, command in dict(given_commands).items():
        give(last, drone, command)
    at, live = np.array(places), [0, 1, 2, 3]
    assert every.missing(live, at) == last.missing(live, at)
    assert every.take(live, at, "search").tolist() == last.take(live, at, "search").tolist()


@given(
    st.dictionaries(st.integers(0, 3), st.integers(0, len(ACTIONS) - 1)),
    st.sets(st.integers(0, 3)),
    st.sampled_from(["search", "repeat", "hold"]),
)
def test_an_action_is_for_one_step_and_for_drones_in_flight(
    actions: dict[int, int], live: set[int], missing_action: str
) -> None:
    buffer, at = buffer_of(SWARM, 4), np.zeros((4, 2), np.int64)
    for drone, action in actions.items():
        buffer.set_action(drone, action)
    active = sorted(live)
    assert buffer.missing(active, at) == [i for i in active if i not in actions]
    joint = buffer.take(active, at, missing_action)
    for drone in range(4):
        if drone not in live:
            assert joint[drone] == NO_ACTION
        elif drone in actions:
            assert joint[drone] == actions[drone]
        else:
            assert joint[drone] == (SEARCH if missing_action == "search" else NO_ACTION)
    assert buffer.missing(active, at) == active


@given(st.integers(0, len(ACTIONS) - 1))
def test_repeat_repeats_the_last_action(action: int) -> None:
    buffer, at = buffer_of(SWARM, 2), np.zeros((2, 2), np.int64)
    buffer.set_action(1, action)
    for _ in range(3):
        assert buffer.take([0, 1], at, "repeat").tolist() == [NO_ACTION, action]


@given(cells, cells)
def test_a_goal_is_flown_cell_by_cell_and_then_it_is_no_command(
    goal: tuple[int, int], start: tuple[int, int]
) -> None:
    buffer, here = buffer_of(SWARM, 1), start
    buffer.set_goal(0, goal)
    visited = [start]
    while not buffer.missing([0], np.array([here])):
        action = int(buffer.take([0], np.array([here]), "hold")[0])
        assert action != SEARCH
        here = moved(here, action)
        visited.append(here)
    assert len(visited) == abs(start[0] - goal[0]) + abs(start[1] - goal[1]) + 1
    assert here == goal and buffer.goal_of(0) is None


def test_goals_are_flown_around_what_is_not_searched_and_out_of_reach_if_none_leads_there() -> None:
    area = np.ones((5, 5), bool)
    area[1:, 2] = False
    area[4, 3] = area[3, 4] = False
    swarm, here = Swarm.alike(ACTIONS, area), (0, 4)
    buffer = buffer_of(swarm, 1)
    goal, unreached = (4, 2), (4, 4)
    assert [swarm.reaches(0, here, cell) for cell in (goal, unreached, (2, 3))] == [
        True,
        False,
        False,
    ]
    buffer.set_goal(0, goal)
    for left in range(4 + 4 + 2, 0, -1):
        assert swarm.moves_to(0, here, goal) == left
        here = moved(here, int(buffer.take([0], np.array([here]), "hold")[0]))
        assert area[here[1], here[0]]
    assert here == goal
    buffer.set_goal(0, unreached)
    assert buffer.take([0], np.array([here]), "hold").tolist() == [SEARCH]


def test_moves_are_counted_from_the_nearest_cell_where_a_drone_is_off_the_grid() -> None:
    area = np.ones((5, 5), bool)
    area[2, 2] = False
    assert Swarm.alike(ACTIONS, area).moves_to(0, (-1, 5), (0, 2)) == 2
    assert SWARM.moves_to(0, (-1, 5), (0, 2)) == 4


def test_goals_are_flown_by_the_moves_of_a_drone_s_kind() -> None:
    actions = ActionSet(tuple(ACTION_VECTORS))
    rook = Searcher(doc="flies straight", moves=("left", "right", "up", "down"))
    never_back = Searcher(doc="flies to the south-east", moves=("right", "down"))
    kinds = (
        actions,
        *(actions.of_kind(kind, GridShape.square(GRID)) for kind in (rook, never_back)),
    )
    swarm = Swarm(actions, kinds, (0, 1, 2))
    buffer = buffer_of(swarm, 3)
    names, at = [], np.zeros((3, 2), np.int64)
    for drone in range(3):
        assert swarm.reaches(drone, (0, 0), (2, 2))
        buffer.set_goal(drone, (2, 2))
    while missing := set(range(3)) - set(buffer.missing([0, 1, 2], at)):
        joint = buffer.take([0, 1, 2], at, "hold")
        for drone in missing:
            names.append((drone, actions.names[joint[drone]]))
            at[drone] += ACTION_VECTORS[names[-1][1]]
    assert [name for drone, name in names if drone == 0] == ["down_right"] * 2
    for drone, kind in ((1, rook), (2, never_back)):
        flown = [name for n, name in names if n == drone]
        assert len(flown) == 4 and all(kind.can_do(name) for name in flown)
    assert not swarm.reaches(2, (2, 2), (1, 4)) and swarm.reaches(2, (2, 2), (4, 4))


@given(st.lists(commands))
def test_clearing_forgets_everything(
    given_commands: list[tuple[int, int | tuple[int, int]]],
) -> None:
    buffer = buffer_of(SWARM, 4)
    at, live = np.zeros((4, 2), np.int64), [0, 1, 2, 3]
    for drone, command in given_commands:
        give(buffer, drone, command)
    buffer.take(live, at, "hold")
    buffer.clear()
    assert buffer.missing(live, at) == live
    assert buffer.take(live, at, "repeat").tolist() == [NO_ACTION] * 4

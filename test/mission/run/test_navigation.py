# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Goals that somebody waits for: each ends once, and as it should."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.navigation import Ended, Ending, Navigation
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.actions import Cell

GRID, DRONES = 7, 3
SEARCH = 4


def mission(**options: Any) -> Mission:
    fields = {"num_drones": DRONES, "grid_size": GRID, "probability_of_detection": 0.0} | options
    return Mission(parallel_env(**fields), 3)


def go(flown: Mission, goals: Navigation[str], drone: int, cell: Cell, name: str) -> list[Any]:
    """Send a drone to a cell, and return the ends of goals until then."""
    flown.commands.set_goal(drone, cell)
    return goals.begin(drone, name)


def ends(ended: list[Ended[str]]) -> list[tuple[str, Ending]]:
    return [(end.handle, end.ending) for end in ended]


def test_a_goal_is_reached_after_as_many_moves_as_were_left() -> None:
    flown = mission(num_drones=1)
    goals = Navigation[str](flown)
    assert go(flown, goals, 0, (4, 2), "a") == []
    for left in range(6, 0, -1):
        (progress,) = goals.progress()
        step_s = flown.env.scenario.step_duration_s
        assert (progress.drone, progress.handle) == (0, "a")
        assert (progress.left_m, progress.left_s) == (130.0 * left, step_s * left)
        assert progress.elapsed_ns == (6 - left) * round(step_s * 1e9)
        assert goals.check(()) == []
        flown.advance("hold")
    assert ends(goals.check(())) == [("a", Ending.REACHED)]
    assert not goals.active and goals.check(()) == []
    assert flown.missing == [0]


def test_a_goal_that_is_already_reached_ends_at_once() -> None:
    flown = mission()
    goals = Navigation[str](flown)
    col, row = flown.result.cells[1].tolist()
    go(flown, goals, 1, (col, row), "here")
    assert ends(goals.check(())) == [("here", Ending.REACHED)]


def test_a_drone_is_there_once_its_vehicle_is() -> None:
    flown = mission(num_drones=1)
    goals = Navigation[str](flown)
    go(flown, goals, 0, (1, 0), "a")
    flown.advance("hold")
    # The command of the next step does not take the goal back.
    flown.commands.set_action(0, SEARCH)
    assert goals.check([0]) == []
    assert ends(goals.check([])) == [("a", Ending.REACHED)]


def test_a_canceled_goal_leaves_the_drone_without_a_command() -> None:
    flown = mission()
    goals = Navigation[str](flown)
    go(flown, goals, 0, (5, 5), "a")
    assert ends(goals.cancel("a")) == [("a", Ending.CANCELED)]
    assert 0 in flown.missing and goals.cancel("a") == [] and goals.check(()) == []


def test_a_late_cancel_does_not_take_back_the_command_that_came_after() -> None:
    flown = mission()
    goals = Navigation[str](flown)
    go(flown, goals, 0, (5, 5), "a")
    flown.commands.set_goal(0, (6, 6))
    goals.cancel("a")
    goal = flown.commands.goal_of(0)
    assert goal is not None and goal.where == (6, 6)


@pytest.mark.parametrize("same", [True, False])
def test_a_new_goal_replaces_the_one_before(same: bool) -> None:
    flown = mission()
    goals = Navigation[str](flown)
    go(flown, goals, 0, (5, 5), "a")
    (ended,) = go(flown, goals, 0, (5, 5) if same else (2, 2), "b")
    assert (ended.handle, ended.ending) == ("a", Ending.ABORTED)
    assert ended.reason == "another command of drone0 has replaced it"
    assert [progress.handle for progress in goals.progress()] == ["b"]


def test_any_other_command_of_its_drone_ends_a_goal_and_none_of_other_drones() -> None:
    flown = mission()
    goals = Navigation[str](flown)
    for command in (
        lambda: flown.commands.set_action(0, SEARCH),
        lambda: flown.commands.set_goal(0, (6, 6)),
        lambda: flown.command_all([SEARCH] * DRONES),
    ):
        go(flown, goals, 0, (5, 5), "a")
        flown.commands.set_action(1, SEARCH)
        assert goals.check(()) == []
        command()
        (ended,) = goals.check(())
        assert ended.reason == "another command of drone0 has replaced it"


def test_the_reason_names_what_happened_to_the_drone_or_the_mission() -> None:
    flown = mission(timestep_limit=4)
    goals = Navigation[str](flown)
    go(flown, goals, 0, (6, 6), "lost")
    go(flown, goals, 1, (6, 6), "reset")
    flown.lose(0)
    (lost,) = goals.check(())
    flown.reset(4)
    (reset,) = goals.check(())
    go(flown, goals, 2, (6, 6), "time")
    while not flown.done:
        assert goals.check(()) == []
        flown.advance("search")
    (time,) = goals.check(())
    assert [end.reason for end in (lost, reset, time)] == [
        "drone0 is lost", "mission 1 was reset", "mission 2 is over: out of time",
    ]  # fmt: skip
    assert {end.ending for end in (lost, reset, time)} == {Ending.ABORTED}


def test_moves_are_those_that_the_rules_have() -> None:
    flown = mission(rules="v2", num_drones=1)
    assert flown.space.swarm.moves_to(0, (0, 0), (3, 3)) == 3
    assert mission(num_drones=1).space.swarm.moves_to(0, (0, 0), (3, 3)) == 6


cells = st.tuples(st.integers(0, GRID - 1), st.integers(0, GRID - 1))
drones = st.integers(0, DRONES - 1)
events = st.one_of(
    st.tuples(st.just("go"), drones, cells),
    st.tuples(st.just("pose"), drones, cells),
    st.tuples(st.just("action"), drones, st.just(SEARCH)),
    st.tuples(st.just("cancel"), drones, st.none()),
    st.tuples(st.just("lose"), drones, st.none()),
    st.tuples(st.just("step"), st.just(0), st.none()),
    st.tuples(st.just("step"), st.just(0), st.none()),
    st.tuples(st.just("reset"), st.just(0), st.none()),
)


@given(st.lists(events, max_size=40), st.lists(drones, max_size=2))
def test_each_goal_ends_once_and_is_reached_only_where_the_drone_is(
    happened: list[tuple[str, int, Any]], late: list[int]
) -> None:
    flown = mission(timestep_limit=12)
    goals = Navigation[int](flown)
    sent: dict[int, Cell] = {}
    ended: list[Ended[int]] = []
    active: dict[int, int] = {}
    for event, drone, value in happened:
        if event == "go" and not flown.refuse(drone):
            active[drone] = handle = len(sent)
            sent[handle] = value
            flown.commands.set_goal(drone, value)
            new = goals.begin(drone, handle)
        elif event == "pose" and not flown.refuse(drone):
            flown.commands.set_goal(drone, value)
            new = goals.check(late)
        elif event == "action" and not flown.refuse(drone):
            flown.commands.set_action(drone, value)
            new = goals.check(late)
        elif event == "cancel":
            new = goals.cancel(active.get(drone, -1))
        else:
            if event == "lose":
                flown.lose(drone)
            elif event == "reset":
                flown.reset(flown.seed + 1)
            elif event == "step" and not flown.done:
                flown.advance("search")
            new = goals.check(late)
        for end in new:
            if end.ending is Ending.REACHED:
                assert tuple(flown.result.cells[end.drone].tolist()) == sent[end.handle]
                assert end.drone not in late
            assert (end.ending is Ending.ABORTED) == bool(end.reason)
        ended += new
    following = [progress.handle for progress in goals.progress()]
    assert Counter([*following, *(end.handle for end in ended)]) == Counter(list(sent))
    flown.reset(99)
    assert {end.handle for end in goals.check(())} == set(following) and not goals.active

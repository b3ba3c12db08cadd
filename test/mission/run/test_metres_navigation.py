# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Goals in metres that somebody waits for: each ends once, and as it should."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.navigation import Ended, Ending, Navigation
from dsse_ros.mission.vehicles.track_follower import TOLERANCE_M
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.searchers import registry
from dsse_ros.world.searchers.searcher import Searcher

DRONES, STEP_S = 2, 13.0
START = 9.5 * 130.0
Point = tuple[float, float]


def mission(**fields: Any) -> Mission:
    options: dict[str, Any] = {
        "rules": "flight", "person_motion": "constant_drift", "grid_size": 20, "particles": 50,
        "drones_positions": ((9, 9), (12, 12)), "sigma": 3.0, "probability_of_detection": 0.0,
    }  # fmt: skip
    flown = Mission(parallel_env(**{**options, **fields}), 3, belief=False)
    return flown


def go(flown: Mission, goals: Navigation[Any], drone: int, to: Point, name: Any) -> list[Any]:
    """Send a drone to a point, and return the ends of goals until then."""
    flown.commands.set_goal(drone, np.array([to]))
    return [*goals.begin(drone, name), *goals.check(())]


def ends(ended: list[Ended[Any]]) -> list[tuple[Any, Ending]]:
    return [(end.handle, end.ending) for end in ended]


def test_the_way_left_is_flown_at_cruise_until_the_drone_is_there() -> None:
    flown = mission()
    goals = Navigation[Any](flown)
    assert go(flown, goals, 0, (START + 300.0, START - 400.0), "a") == []
    for steps in range(4):
        (progress,) = goals.progress()
        left_m = 500.0 - 130.0 * steps
        assert (progress.drone, progress.handle) == (0, "a")
        # A step ends at one of 64 points of the part of the track that is within reach.
        assert progress.left_m == pytest.approx(left_m, abs=0.01 + steps * 130 / 64)
        assert progress.left_s == pytest.approx(progress.left_m / 10.0)
        assert progress.elapsed_ns == steps * round(STEP_S * 1e9)
        assert goals.check(()) == []
        flown.advance("hold")
    assert ends(goals.check(())) == [("a", Ending.REACHED)]
    assert not goals.active and 0 in flown.missing


@pytest.mark.parametrize("toward", [90.0, 270.0, 0.0])
def test_wind_is_in_the_time_left(toward: float) -> None:
    flown = mission(wind_speed=6.0, wind_toward=toward)
    goals = Navigation[Any](flown)
    go(flown, goals, 0, (START + 900.0, START), "a")
    (progress,) = goals.progress()
    speed = {90.0: 16.0, 270.0: 4.0, 0.0: 8.0}[toward]
    assert progress.left_m == pytest.approx(900.0)
    assert progress.left_s == pytest.approx(900.0 / speed)
    steps = 0
    while not goals.check(()):
        flown.advance("hold")
        steps += 1
    # It is there within the tolerance, after whole steps.
    assert abs(steps * STEP_S - progress.left_s) <= STEP_S + TOLERANCE_M / speed


def test_a_goal_where_the_drone_is_ends_at_once() -> None:
    flown = mission()
    goals = Navigation[Any](flown)
    assert ends(go(flown, goals, 0, (START + 5.0, START), "here")) == [("here", Ending.REACHED)]
    assert flown.missing == [0, 1]


def test_a_plane_is_there_within_its_turn_radius(monkeypatch: pytest.MonkeyPatch) -> None:
    plane = Searcher(doc="a plane", speed=15.0, min_speed=11.0, turn_radius=60.0)
    monkeypatch.setitem(registry.SEARCHERS, "plane", plane)
    flown = mission(searchers=("plane",))
    goals = Navigation[Any](flown)
    to = np.array([START - 700.0, START + 300.0])
    go(flown, goals, 0, (float(to[0]), float(to[1])), "a")
    paths = []
    while not (ended := goals.check(())):
        result = flown.advance("search")
        assert result.flown is not None
        paths.append(result.flown.paths[0])
    assert ends(ended) == [("a", Ending.REACHED)]
    assert np.hypot(*(np.concatenate(paths) - to).T).min() <= 60.0 + 1.0


def test_a_canceled_goal_leaves_the_drone_without_a_command() -> None:
    flown = mission()
    goals = Navigation[Any](flown)
    go(flown, goals, 0, (START + 900.0, START), "a")
    assert ends(goals.cancel("a")) == [("a", Ending.CANCELED)]
    assert 0 in flown.missing and goals.cancel("a") == [] and goals.check(()) == []


def test_a_late_cancel_does_not_take_back_the_command_that_came_after() -> None:
    flown = mission()
    goals = Navigation[Any](flown)
    go(flown, goals, 0, (START + 900.0, START), "a")
    flown.commands.set_goal(0, np.array([(200.0, 200.0)]))
    goals.cancel("a")
    goal = flown.commands.goal_of(0)
    assert goal is not None and goal.where.points[-1].tolist() == [200.0, 200.0]


@pytest.mark.parametrize("same", [True, False])
def test_a_new_goal_replaces_the_one_before(same: bool) -> None:
    flown = mission()
    goals = Navigation[Any](flown)
    go(flown, goals, 0, (300.0, 300.0), "a")
    (ended,) = go(flown, goals, 0, (300.0, 300.0) if same else (900.0, 300.0), "b")
    assert (ended.handle, ended.ending) == ("a", Ending.ABORTED)
    assert ended.reason == "another command of drone0 has replaced it"
    assert [progress.handle for progress in goals.progress()] == ["b"]


def test_any_other_command_of_its_drone_ends_a_goal_and_none_of_other_drones() -> None:
    flown = mission()
    goals = Navigation[Any](flown)
    for command in (
        lambda: flown.commands.set_action(0, (0.5, 1.0)),
        lambda: flown.commands.set_goal(0, np.array([(300.0, 300.0)])),
        lambda: flown.command_all([(0.0, 1.0)] * DRONES),
    ):
        go(flown, goals, 0, (300.0, 300.0), "a")
        flown.commands.set_action(1, (0.0, 0.0))
        assert goals.check(()) == []
        command()
        (ended,) = goals.check(())
        assert ended.reason == "another command of drone0 has replaced it"


points = st.tuples(st.floats(100.0, 2500.0), st.floats(100.0, 2500.0))
drones = st.integers(0, DRONES - 1)
events = st.one_of(
    st.tuples(st.just("go"), drones, points),
    st.tuples(st.just("go"), drones, points),
    st.tuples(st.just("action"), drones, st.none()),
    st.tuples(st.just("cancel"), drones, st.none()),
    st.tuples(st.just("lose"), drones, st.none()),
    *[st.tuples(st.just("step"), st.just(0), st.none())] * 4,
    st.tuples(st.just("reset"), st.just(0), st.none()),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(events, max_size=40))
def test_each_goal_ends_once_and_is_reached_only_where_the_drone_was(
    happened: list[tuple[str, int, Any]],
) -> None:
    flown = mission(timestep_limit=25)
    goals = Navigation[Any](flown)
    sent: list[Point] = []
    ended: list[Ended[Any]] = []
    active: dict[int, int] = {}
    for event, drone, value in happened:
        new: list[Ended[Any]] = []
        if event == "go" and not flown.refuse(drone):
            active[drone] = len(sent)
            sent.append(value)
            new = go(flown, goals, drone, value, active[drone])
        elif event == "action" and not flown.refuse(drone):
            flown.commands.set_action(drone, (0.3, 1.0))
        elif event == "cancel":
            new = goals.cancel(active.get(drone, -1))
        elif event == "lose":
            flown.lose(drone)
        elif event == "reset":
            flown.reset(flown.seed + 1)
        elif event == "step" and not flown.done:
            flown.advance("hold")
        new += goals.check(())
        for one in new:
            if one.ending is Ending.REACHED:
                assert flown.result.flown is not None
                path = flown.result.flown.paths[one.drone]
                legs = path[0] + np.linspace(0, 1, 200)[:, None] * (path[-1] - path[0])
                assert np.hypot(*(legs - sent[one.handle]).T).min() <= TOLERANCE_M + 1.0
            assert (one.ending is Ending.ABORTED) == bool(one.reason)
        ended += new
    following = [progress.handle for progress in goals.progress()]
    assert Counter([*following, *(end.handle for end in ended)]) == Counter(range(len(sent)))
    flown.reset(99)
    assert {end.handle for end in goals.check(())} == set(following) and not goals.active

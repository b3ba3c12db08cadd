# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions in metres without ROS: their commands, steps, snapshots and messages."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.run.metres_parsers import Velocity, action_of
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_reports import mission_report_of, step_report_of
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.snapshot import SnapshotError
from dsse_ros.search.step.metres_paths import MOST_PIECES
from dsse_ros.world.scenario.scenario import scenario_frame
from dsse_ros.world.searchers import registry
from dsse_ros.world.searchers.searcher import Searcher
from msg_adapters.step_report import path_of

PLACE: dict[str, Any] = {
    "rules": "flight", "person_motion": "constant_drift", "grid_size": 20, "particles": 500,
    "drones_positions": ((9, 9), (10, 10), (3, 3)), "vector": (0.3, 0.1), "sigma": 3.0,
    "wind_speed": 4.0, "wind_toward": 30.0,
}  # fmt: skip
actions = st.tuples(st.floats(-1, 1), st.floats(-1, 1))
joints = st.lists(st.tuples(actions, actions, actions), min_size=1, max_size=10)


def mission(seed: int = 3, **given: Any) -> Mission:
    flown = Mission(parallel_env(**{**PLACE, **given}), seed)
    return flown


def fly(flown: Mission, joint: Any) -> Any:
    flown.command_all(joint)
    return flown.advance("search")


def state(played: Mission) -> tuple[Any, ...]:
    frame = scenario_frame(played.env.scenario)
    return (
        played.env.world.state_bytes(), played.pos, played.tracks, played.belief().tobytes(),
        step_report_of(played, frame, 1).tobytes(), mission_report_of(played, frame, 1).tobytes(),
    )  # fmt: skip


@settings(max_examples=20, deadline=None)
@given(joints, st.integers(0, 100))
def test_a_mission_is_step_by_step_the_environment(steps: list[Any], seed: int) -> None:
    flown, env = mission(seed), parallel_env(**PLACE, observe="belief")
    env.reset(seed=seed)
    for joint in steps:
        if not env.agents:
            break
        _, rewards, _, _, infos = env.step(
            {agent: np.array(joint[int(agent[5:])]) for agent in env.agents}
        )
        result = fly(flown, joint)
        assert result.flown is not None
        report = step_report_of(flown, scenario_frame(env.scenario), 1)
        for agent, info in infos.items():
            i = int(agent[5:])
            assert path_of(report)[i].tobytes() == info["path"].tobytes()
            assert (result.rewards[i], flown.pos) == (rewards[agent], info["pos"])
    assert flown.env.world.state_bytes() == env.world.state_bytes()
    assert flown.done == (not env.agents)


@settings(max_examples=20, deadline=None)
@given(joints, joints)
def test_a_mission_goes_on_from_its_snapshot_bit_for_bit(before: Any, after: Any) -> None:
    flown, other = mission(), mission(99)
    for joint in before:
        fly(flown, joint)
    other.restore(flown.snapshot())
    assert state(other) == state(flown)
    for joint in after:
        fly(flown, joint)
        fly(other, joint)
        assert state(other) == state(flown)


@pytest.mark.parametrize(
    "name", ["result_actions_m", "result_paths_m", "motion_states", "history", "worlds"]
)
def test_a_snapshot_that_is_impossible_is_refused_with_nothing_changed(name: str) -> None:
    flown, other = mission(), mission(99)
    fly(flown, [(0.1, 1.0)] * 3)
    snapshot, before = flown.snapshot(), state(other)
    array = snapshot.arrays[name]
    if array.dtype.names is None:
        array[...] = math.nan
    elif name == "motion_states":
        array["east"] = math.nan
    else:
        snapshot.arrays[name] = array[:0]
    with pytest.raises(SnapshotError) as refused:
        other.restore(snapshot)
    assert "\n" not in str(refused.value) and state(other) == before


@pytest.mark.parametrize(
    ("missing_action", "min_speed", "speed", "held"),
    [("search", 0.0, 1.0, False), ("hold", 0.0, 0.0, True), ("hold", 6.0, 0.6, True)],
)
def test_a_drone_without_a_command_flies_on_stops_or_circles(
    missing_action: str,
    min_speed: float,
    speed: float,
    held: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plane = Searcher(doc="plane", speed=10.0, min_speed=min_speed, turn_radius=60.0)
    monkeypatch.setitem(registry.SEARCHERS, "plane", plane)
    flown = mission(searchers=("plane",), wind_speed=0.0)
    flown.commands.set_action(0, (0.0, 1.0))
    result = flown.advance(missing_action)
    assert result.flown is not None
    assert result.flown.flights["speed"].tolist() == pytest.approx([10.0, 10 * speed, 10 * speed])
    assert result.held.tolist() == [False, held, held]
    turned = (result.flown.actions[1:, 0] != 0.0).tolist()
    assert turned == [held and min_speed > 0.0] * 2
    # The last one is flown again.
    flown.commands.set_action(0, (0.5, 0.0))
    flown.advance("search")
    again = flown.advance("repeat")
    assert again.flown is not None and again.flown.actions[0].tolist() == [0.5, 0.0]


@settings(max_examples=30, deadline=None)
@given(
    st.floats(-5, 30), st.floats(-1, 1), st.sampled_from([0.0, 60.0]), st.sampled_from([0.0, 6.0])
)
def test_a_velocity_is_flown_as_far_as_the_kind_of_drone_can(
    forward: float, yaw_rate: float, radius: float, lowest: float
) -> None:
    plane = Searcher(doc="plane", speed=10.0, min_speed=lowest, turn_radius=radius)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(registry.SEARCHERS, "plane", plane)
        flown = mission(searchers=("plane",), wind_speed=0.0)
        before = flown.env.world.metres.states[0, 0].copy()  # type: ignore[union-attr]
        airframe, step_s = flown.space.airframes[0], flown.env.scenario.step_duration_s
        flown.commands.set_action(0, action_of(Velocity(forward, yaw_rate), airframe, step_s))
        after = flown.advance("search").flown.flights[0]  # type: ignore[union-attr]
    speed = min(max(forward, lowest), 10.0)
    assert after["speed"] == pytest.approx(speed)
    most = min(speed * step_s / radius, math.pi) if radius else math.pi
    turned = math.remainder(after["heading"] - before["heading"], 2 * math.pi)
    wanted = -min(max(yaw_rate * step_s, -most), most)
    assert math.cos(turned - wanted) == pytest.approx(1.0)


def test_a_lost_drone_stays_where_it_is() -> None:
    flown = mission(probability_of_detection=0.0)
    where = flown.result.places[1].tolist()
    assert flown.lose(1)
    result = fly(flown, [(0.0, 1.0)] * 3)
    assert result.places[1].tolist() == where and result.terminated.tolist() == [False, True, False]


def test_the_mission_report_has_the_exact_positions() -> None:
    flown = mission(probability_of_detection=0.0)
    frame, reports = scenario_frame(flown.env.scenario), []
    for joint in ([(0.1, 1.0)] * 3, [(-0.2, 0.3)] * 3):
        reports.append(step_report_of(flown, frame, 1))
        fly(flown, joint)
    reports.append(step_report_of(flown, frame, 1))
    whole = mission_report_of(flown, frame, 1)
    for name in whole.dtype.names or ():
        assert whole[name].tolist() == [report[name].tolist() for report in reports]
    ends = path_of(reports[-1])[:, -1]
    assert reports[-1]["x"].tolist() == pytest.approx(ends[:, 0].tolist())
    assert reports[-1]["y"].tolist() == pytest.approx((20 * 130.0 - ends[:, 1]).tolist())


def test_all_of_a_result_is_of_the_last_step() -> None:
    flown = mission()
    kept = fly(flown, [(0.1, 1.0)] * 3)
    copies = {field.name: getattr(kept.flown, field.name).copy() for field in fields(kept.flown)}
    fly(flown, [(-0.4, 0.0)] * 3)
    for name, copy in copies.items():
        assert getattr(kept.flown, name).tobytes() == copy.tobytes()


@pytest.mark.parametrize(
    ("way", "outside_m"), [((1, 0), 1.0), ((-1, 0), 300.0), ((0, 1), 1e4), ((0, -1), 1e9)]
)
def test_a_vehicle_off_the_grid_is_where_it_is(way: tuple[int, int], outside_m: float) -> None:
    place: dict[str, Any] = {
        "drones_positions": ((10, 10),), "sigma": 40.0, "vehicle_timed_actions": True
    }  # fmt: skip
    flown, other = mission(**place), mission(99, **place)
    cell_m = flown.env.scenario.cell_size
    side_m, along = 20 * cell_m, np.linspace(0.1, 0.9, MOST_PIECES + 1)[:, None] * 20 * cell_m
    beyond = np.where(np.array(way) > 0, side_m + outside_m, -outside_m)
    path = np.where(np.array(way) != 0, beyond, along)
    flown.set_flown(0, path, np.ones(MOST_PIECES + 1, bool))
    fly(flown, [(0.0, 1.0)])
    result, env = flown.result, flown.env
    assert result.flown is not None
    assert result.flown.paths[0] == pytest.approx(path, rel=1e-9)
    far = 2**15 - 1
    assert result.cells[0].tolist() == np.clip(np.floor(path[-1] / cell_m), -far, far).tolist()
    assert env._observe(["drone0"], [0])[0]["drone0"][0][:2] == pytest.approx(path[-1] / side_m)
    assert outside_m < 100.0 or (flown.pos == 0.0 and not result.found.any())
    other.restore(flown.snapshot())
    assert state(other) == state(flown)


def test_a_vehicle_just_off_the_grid_sees_over_its_edge() -> None:
    pos = []
    for outside_m in (-60.0, 10.0, 60.0, 130.0):
        flown = mission(
            drones_positions=((10, 10),), sigma=40.0, particles=5000, vehicle_timed_actions=True
        )
        side_m = 20 * flown.env.scenario.cell_size
        ends = np.linspace(0.1 * side_m, 0.9 * side_m, MOST_PIECES + 1)
        path = np.stack([np.full(len(ends), side_m + outside_m), ends], axis=1)
        flown.set_flown(0, path, np.ones(len(ends), bool))
        fly(flown, [(0.0, 1.0)])
        pos.append(flown.pos)
    assert pos[0] > pos[1] > pos[2] > pos[3] == 0.0


# The wind that vehicles report

WINDS = st.tuples(st.floats(-6, 6), st.floats(-6, 6))


def drifts(flown: Mission) -> list[tuple[float, float]]:
    """Return how far each drone would be carried in a step if it stood in the air."""
    ways = flown.ways(np.zeros((3, 2)) + (0.0, -1.0)) * flown.env.scenario.cell_size
    return [tuple(way[-1] - way[0]) for way in ways]


@given(WINDS)
def test_the_next_step_is_planned_in_the_wind_that_is_reported(wind: tuple[float, float]) -> None:
    flown = mission(vehicle_timed_actions=True)
    step_s = flown.env.scenario.step_duration_s
    flown.report_wind(wind)
    for east_m, south_m in drifts(flown):
        # A drone brakes first.
        assert (east_m, -south_m) == pytest.approx(
            (wind[0] * step_s, wind[1] * step_s), abs=8.0 * step_s
        )
    before = drifts(flown)
    flown.report_wind((wind[0] + 1.0, wind[1] - 2.0))
    moved = np.array(drifts(flown)) - before
    assert moved == pytest.approx(np.tile((step_s, 2.0 * step_s), (3, 1)))


def test_a_step_that_has_begun_ends_in_the_wind_it_was_planned_in() -> None:
    flown, other = mission(vehicle_timed_actions=True), mission(vehicle_timed_actions=True)
    for one in (flown, other):
        one.command_all([(0.2, 1.0)] * 3)
        one.begin("hold")
    flown.report_wind((5.0, 0.0))
    assert flown.env.world.metres is not None
    assert flown.env.world.metres.wind_mps == pytest.approx((2.0, 3.464), abs=1e-3)
    first, second = flown.advance("hold"), other.advance("hold")
    assert first.flown is not None and second.flown is not None
    assert first.flown.paths.tobytes() == second.flown.paths.tobytes()
    assert flown.env.world.metres.wind_mps == (5.0, 0.0)


@settings(max_examples=10, deadline=None)
@given(joints, joints, WINDS)
def test_a_mission_goes_on_from_its_snapshot_in_the_wind_that_was_reported(
    before: Any, after: Any, wind: tuple[float, float]
) -> None:
    flown, other = mission(vehicle_timed_actions=True), mission(99, vehicle_timed_actions=True)
    flown.report_wind(wind)
    for joint in before:
        if not flown.done:
            fly(flown, joint)
    other.restore(flown.snapshot())
    assert state(other) == state(flown)
    for joint in after:
        if not flown.done:
            fly(flown, joint)
            fly(other, joint)
    assert state(other) == state(flown)


@pytest.mark.parametrize("wind", [(10.0, 0.0), (-8.0, 8.0), (math.nan, 0.0), (0.0, math.inf)])
def test_a_wind_against_which_no_drone_can_fly_is_refused(wind: tuple[float, float]) -> None:
    flown = mission(vehicle_timed_actions=True)
    before = flown.snapshot()
    with pytest.raises(FieldError, match=r"^vehicle_wind must be below drone_speed, 10 m/s, or "):
        flown.report_wind(wind)
    assert flown.snapshot().extra == before.extra
    before.extra["wind"] = list(wind)
    with pytest.raises(SnapshotError, match=r"an impossible mission: wind$"):
        flown.restore(before)


def test_a_mission_begins_in_the_wind_of_its_scenario() -> None:
    flown, other = mission(vehicle_timed_actions=True), mission(vehicle_timed_actions=True)
    flown.report_wind((-5.0, 1.0))
    fly(flown, [(0.0, 1.0)] * 3)
    for one in (flown, other):
        one.reset(4)
        fly(one, [(0.0, 1.0)] * 3)
    assert flown.env.world.state_bytes() == other.env.world.state_bytes()

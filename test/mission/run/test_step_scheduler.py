# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""When a mission steps, with times made up."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.mission.run.step_scheduler import Due, StepScheduler, Timing

timings = st.builds(
    Timing,
    mode=st.sampled_from(["lockstep", "realtime", "manual"]),
    step_rate=st.sampled_from([0.0, 0.5, 10.0, 1e6]),
    command_timeout_s=st.sampled_from([0.0, 0.2, 30.0]),
    real_time_factor=st.sampled_from([0.5, 1.0, 100.0]),
    step_duration_s=st.sampled_from([1.0, 13.0]),
)


def scheduler(now_s: float = 0.0, **timing: object) -> StepScheduler:
    made = StepScheduler(Timing(**timing), now_s)  # type: ignore[arg-type]
    made.begin(now_s, done=False)
    return made


def test_lockstep_steps_as_soon_as_all_is_there_and_never_before() -> None:
    lockstep = scheduler()
    assert lockstep.due(1e6, ready=False) is Due.NOTHING
    assert lockstep.wait_s(1e6, ready=False) == math.inf
    assert lockstep.due(1e6, ready=True) is Due.STEP


def test_lockstep_with_a_rate_steps_no_faster() -> None:
    lockstep = scheduler(step_rate=4.0)
    assert lockstep.due(0.2, ready=True) is Due.NOTHING
    assert lockstep.wait_s(0.2, ready=True) == pytest.approx(0.05)
    assert lockstep.due(0.25, ready=True) is Due.STEP
    lockstep.begin(0.9, done=False)
    # What was late is not made up for: the rate is the highest.
    assert lockstep.wait_s(0.9, ready=True) == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("timing", "time_s"),
    [
        ({}, None),
        ({"step_rate": 4.0}, None),
        ({"command_timeout_s": 2.0, "step_rate": 4.0}, 2.0),
        ({"command_timeout_s": 2.0, "step_rate": 0.25}, 4.0),
        ({"mode": "manual", "command_timeout_s": 2.0, "step_rate": 4.0}, None),
        ({"mode": "realtime", "command_timeout_s": 2.0, "step_rate": 4.0}, 0.25),
        ({"mode": "realtime", "step_duration_s": 13.0, "real_time_factor": 10.0}, 1.3),
    ],
)
def test_a_decision_has_the_time_that_a_step_waits(
    timing: dict[str, Any], time_s: float | None
) -> None:
    assert Timing(**timing).decision_time_s == time_s


def test_what_is_missing_is_waited_for_until_the_timeout() -> None:
    lockstep = scheduler(command_timeout_s=2.0)
    assert lockstep.wait_s(0.5, ready=False) == pytest.approx(1.5)
    assert lockstep.due(1.9, ready=False) is Due.NOTHING
    assert lockstep.due(2.0, ready=False) is Due.TIMEOUT
    assert lockstep.due(2.0, ready=True) is Due.STEP


def test_a_timeout_waits_for_the_rate() -> None:
    lockstep = scheduler(command_timeout_s=1.0, step_rate=0.25)
    assert lockstep.due(3.9, ready=False) is Due.NOTHING
    assert lockstep.due(4.0, ready=False) is Due.TIMEOUT


def test_a_step_that_the_rate_holds_back_does_not_time_out() -> None:
    lockstep = scheduler(command_timeout_s=1.0, step_rate=0.25)
    assert lockstep.due(2.0, ready=True) is Due.NOTHING
    assert lockstep.due(4.0, ready=True) is Due.STEP


def test_a_vehicle_that_leaves_its_cell_again_is_waited_for_no_longer_than_the_timeout() -> None:
    lockstep = scheduler(command_timeout_s=1.0, step_rate=0.25)
    assert lockstep.due(2.0, ready=True) is Due.NOTHING
    assert lockstep.due(5.0, ready=False) is Due.TIMEOUT


def test_real_time_steps_by_time_alone() -> None:
    realtime = scheduler(mode="realtime", step_duration_s=13.0, real_time_factor=2.0)
    for ready in (False, True):
        assert realtime.due(6.4, ready=ready) is Due.NOTHING
        assert realtime.due(6.5, ready=ready) is Due.TICK
    assert realtime.share(3.25) == pytest.approx(0.5)


def test_real_time_makes_up_for_a_late_step() -> None:
    realtime = scheduler(mode="realtime", step_rate=1.0)
    realtime.begin(1.3, done=False)
    assert realtime.wait_s(1.3, ready=False) == pytest.approx(0.7)


def test_manual_steps_wait_to_be_asked_for() -> None:
    manual = scheduler(mode="manual", step_rate=5.0, command_timeout_s=1.0)
    assert manual.due(1e6, ready=True) is Due.NOTHING
    assert manual.wait_s(1e6, ready=True) == math.inf


@given(timings, st.booleans())
def test_nothing_is_due_while_paused_or_over(timing: Timing, ready: bool) -> None:
    paused, done = StepScheduler(timing, 0.0), StepScheduler(timing, 0.0)
    paused.begin(0.0, done=False)
    paused.pause(True, 0.0)
    done.begin(0.0, done=False)
    done.end()
    for each in (paused, done):
        assert each.due(1e9, ready=ready) is Due.NOTHING
        assert each.wait_s(1e9, ready=ready) == math.inf
    assert not done.moving


def test_a_pause_takes_nothing_from_the_step_and_starts_the_timeout_anew() -> None:
    realtime = scheduler(mode="realtime", step_rate=0.1)
    realtime.pause(True, 4.0)
    assert realtime.moving and realtime.share(50.0) == pytest.approx(0.4)
    realtime.pause(False, 100.0)
    assert realtime.wait_s(100.0, ready=False) == pytest.approx(6.0)
    lockstep = scheduler(command_timeout_s=2.0)
    lockstep.pause(True, 1.0)
    lockstep.pause(False, 50.0)
    assert lockstep.wait_s(50.0, ready=False) == pytest.approx(2.0)


def test_a_mission_that_begins_anew_is_no_longer_over() -> None:
    lockstep = scheduler()
    lockstep.end()
    lockstep.begin(5.0, done=False)
    assert lockstep.due(5.0, ready=True) is Due.STEP


def test_a_change_of_mode_keeps_the_share_of_the_step() -> None:
    changed = scheduler(mode="realtime", step_rate=0.1)
    changed.set_timing(Timing(mode="manual"), 4.0)
    assert changed.share(90.0) == pytest.approx(0.4)
    changed.set_timing(Timing(mode="realtime", step_rate=1.0), 90.0)
    assert changed.wait_s(90.0, ready=False) == pytest.approx(0.6)


@given(st.lists(st.floats(0, 60), max_size=40), st.sampled_from(["lockstep", "realtime"]))
def test_steps_by_the_vehicles_take_their_time_whatever_the_wall_clock_says(
    passed: list[float], mode: str
) -> None:
    timed = scheduler(mode=mode, step_duration_s=13.0, step_rate=5.0, by_vehicles=True)
    assert timed.due(1e6, ready=True) is Due.NOTHING and not timed.started
    fleet_s, wall_s, steps = 500.0, 0.0, 0
    timed.set_fleet_time(90.0)
    timed.start(fleet_s)
    for gap in passed:
        fleet_s, wall_s = fleet_s + gap, wall_s + 1.0
        timed.set_fleet_time(fleet_s)
        # Steps that are late are made up for, one by one.
        while timed.due(wall_s, ready=True) is not Due.NOTHING:
            assert timed.wait_s(wall_s, ready=True) == 0.0
            ahead_s = fleet_s - 500.0 - 13.0 * (steps + 1)
            assert timed.fleet_ahead_s == pytest.approx(ahead_s, abs=1e-6)
            timed.begin(wall_s, done=False)
            steps += 1
        assert timed.wait_s(wall_s, ready=True) == math.inf
    assert steps == pytest.approx((fleet_s - 500.0) / 13.0, abs=1.0 + 1e-6)
    assert steps <= (fleet_s - 500.0) / 13.0 + 1e-6


def test_a_step_by_the_vehicles_waits_for_commands_until_the_timeout() -> None:
    timed = scheduler(step_duration_s=13.0, command_timeout_s=5.0, by_vehicles=True)
    timed.start(0.0)
    timed.set_fleet_time(12.9)
    assert timed.due(1e3, ready=False) is Due.NOTHING
    timed.set_fleet_time(13.0)
    assert timed.due(4.9, ready=False) is Due.NOTHING
    assert timed.due(5.0, ready=False) is Due.TIMEOUT
    timed.stop()
    assert not timed.started


actions = st.one_of(
    st.tuples(st.just("timing"), timings),
    st.tuples(st.just("pause"), st.booleans()),
    st.tuples(st.just("ready"), st.booleans()),
    st.tuples(st.just("pass"), st.floats(0, 20)),
    st.tuples(st.just("wait"), st.none()),
)


@pytest.mark.slow
@given(timings, st.lists(actions, max_size=40), st.floats(0, 1e6))
def test_a_caller_who_waits_that_long_finds_something_due_and_nothing_before(
    timing: Timing, happenings: list[tuple[str, object]], now: float
) -> None:
    paced, ready, share = StepScheduler(timing, now), False, 0.0
    paced.begin(now, done=False)
    for kind, value in happenings:
        if isinstance(value, Timing):
            paced.set_timing(value, now)
        elif kind == "pause":
            paced.pause(bool(value), now)
        elif kind == "ready":
            ready = bool(value)
        elif isinstance(value, float):
            now += value
        assert share <= paced.share(now) <= 1.0
        share = paced.share(now)
        wait = paced.wait_s(now, ready=ready)
        if math.isinf(wait):
            assert paced.due(now, ready=ready) is Due.NOTHING
            continue
        if wait > 1e-6:
            assert paced.due(now + 0.9 * wait, ready=ready) is Due.NOTHING
        if kind != "wait":
            continue
        now += wait
        due = paced.due(now, ready=ready)
        if paced.timing.mode == "realtime":
            assert due is Due.TICK
        else:
            assert due is (Due.STEP if ready else Due.TIMEOUT)
        paced.begin(now, done=False)
        share = 0.0

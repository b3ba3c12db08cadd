# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""One clock from those of the vehicles."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.mission.vehicles.fleet_clock import MAX_LEAD_MS, MAX_SKIP_MS, WRAP_MS, FleetClock

gaps = st.integers(0, MAX_SKIP_MS)
boots = st.integers(0, WRAP_MS - 1)


def after(boot_ms: int, passed: Sequence[int]) -> FleetClock:
    """The clock after one vehicle has reported after each gap."""
    clock, now_ms = FleetClock(), boot_ms
    clock.set_time(0, now_ms)
    for gap in passed:
        now_ms = (now_ms + gap) % WRAP_MS
        clock.set_time(0, now_ms)
    return clock


@given(boots, st.lists(gaps, max_size=20))
def test_one_vehicle_is_followed_to_the_millisecond_whenever_it_was_started(
    boot_ms: int, passed: list[int]
) -> None:
    assert after(boot_ms, passed).time_s == pytest.approx(sum(passed) * 1e-3, abs=1e-9)


def test_the_wrap_after_49_days_is_no_restart() -> None:
    assert after(WRAP_MS - 100, [300]).time_s == pytest.approx(0.3)


@given(st.integers(MAX_SKIP_MS + 1, WRAP_MS - MAX_SKIP_MS - 1), gaps)
def test_a_clock_that_jumps_goes_on_from_there(to_ms: int, gap: int) -> None:
    for before, behind in ((0, to_ms), (to_ms, 0)):
        clock = FleetClock()
        for now_ms in (before, behind, behind + gap):
            clock.set_time(0, now_ms)
        assert clock.time_s == pytest.approx(gap * 1e-3)


def test_an_autopilot_that_restarts_loses_only_the_time_of_its_restart() -> None:
    clock = FleetClock()
    for now_ms in (500_000, 501_000, 2_000, 3_000):
        clock.set_time(0, now_ms)
    assert clock.time_s == pytest.approx(2.0)


reports = st.lists(st.tuples(st.integers(0, 2), st.integers(1, 1000)), max_size=60)


@given(st.lists(boots, min_size=3, max_size=3), reports)
def test_vehicles_of_one_speed_are_followed_within_a_report_in_any_order(
    started: list[int], happenings: list[tuple[int, int]]
) -> None:
    clock, true_ms, seen = FleetClock(), 0, [0, 0, 0]
    for vehicle, boot_ms in enumerate(started):
        clock.set_time(vehicle, boot_ms)
    for vehicle, gap in happenings:
        true_ms += gap
        seen[vehicle] = true_ms
        clock.set_time(vehicle, (started[vehicle] + true_ms) % WRAP_MS)
    if max(true_ms - seen_ms for seen_ms in seen) < MAX_LEAD_MS:
        assert clock.time_s == pytest.approx(sorted(seen)[1] * 1e-3, abs=1e-9)


@given(st.lists(st.tuples(st.integers(0, 3), st.one_of(st.none(), boots)), max_size=60))
def test_it_never_runs_backwards_whatever_is_reported_or_dropped(
    happenings: list[tuple[int, int | None]],
) -> None:
    clock, before_s = FleetClock(), 0.0
    for vehicle, boot_ms in happenings:
        if boot_ms is None:
            clock.keep({0, 1, 2, 3} - {vehicle})
        else:
            clock.set_time(vehicle, boot_ms)
        assert clock.time_s >= before_s
        before_s = clock.time_s


def test_the_slower_of_two_sets_the_pace_and_a_silent_one_of_three_does_not() -> None:
    clock = FleetClock()
    for vehicle in range(3):
        clock.set_time(vehicle, 0)
    for now_ms in range(100, 10_100, 100):
        clock.set_time(0, now_ms)
        clock.set_time(1, 2 * now_ms)
    assert clock.time_s == pytest.approx(10.0)
    two = FleetClock()
    for now_ms in range(0, 10_100, 100):
        two.set_time(0, now_ms)
        two.set_time(1, 2 * now_ms)
    assert two.time_s == pytest.approx(10.0)


def test_without_the_silent_one_the_time_of_the_other_counts() -> None:
    clock = FleetClock()
    clock.set_time(0, 0)
    clock.set_time(1, 0)
    clock.set_time(1, 20_000)
    assert clock.time_s == 0.0
    clock.keep([1])
    assert clock.time_s == pytest.approx(20.0)


def test_time_before_the_beginning_does_not_count_when_a_silent_vehicle_is_dropped() -> None:
    clock = FleetClock()
    clock.set_time(1, 0)
    for now_ms in (0, 30_000):
        clock.set_time(0, now_ms)
    clock.begin()
    clock.keep([0])
    assert clock.time_s == 0.0
    clock.set_time(0, 31_000)
    assert clock.time_s == 1.0


def test_a_vehicle_is_silent_while_the_others_go_on_and_not_once_it_is_back() -> None:
    clock = FleetClock()
    for vehicle in range(3):
        clock.set_time(vehicle, 0)
    for now_ms in (6_000, 13_000):
        clock.set_time(0, now_ms)
        clock.set_time(1, now_ms)
    assert [clock.silent_s(vehicle) for vehicle in range(3)] == [0.0, 0.0, 13.0]
    clock.set_time(2, 13_000)
    assert clock.silent_s(2) == 0.0
    # All were silent, and come back one after the other.
    for vehicle in range(3):
        clock.set_time(vehicle, 40_000)
    assert [clock.silent_s(vehicle) for vehicle in range(3)] == [0.0, 0.0, 0.0]


def test_a_clock_that_is_slower_is_not_silent() -> None:
    clock = FleetClock()
    for step in range(20):
        for vehicle, speed in enumerate((1000, 1000, 800)):
            clock.set_time(vehicle, speed * step)
    assert clock.silent_s(2) == 0.0

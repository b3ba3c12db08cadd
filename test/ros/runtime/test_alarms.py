# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Alarms, rung with a made-up clock."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.ros.runtime.alarms import Alarms


class Time:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


@given(st.lists(st.floats(0, 10), max_size=8), st.lists(st.floats(0, 3), max_size=10))
def test_each_alarm_rings_once_when_it_is_due(delays: list[float], waits: list[float]) -> None:
    time, rung = Time(), []
    alarms = Alarms(time)
    made = [alarms.make(lambda i=i: rung.append(i)) for i in range(len(delays))]  # type: ignore[misc]
    for alarm, delay in zip(made, delays, strict=True):
        alarm.set(delay)
    for wait in [0.0, *waits]:
        time.now_s += wait
        alarms.ring()
        due = [i for i, delay in enumerate(delays) if delay <= time.now_s]
        assert sorted(rung) == due
        assert [alarm.due_s < math.inf for alarm in made] == [
            i not in due for i in range(len(delays))
        ]
    left = [delay - time.now_s for delay in delays if delay > time.now_s]
    assert alarms.wait_s() == pytest.approx(min(left, default=math.inf))


def test_alarms_ring_in_the_order_in_which_they_are_due() -> None:
    time, rung = Time(), []
    alarms = Alarms(time)
    for name, delay in (("c", 3.0), ("a", 1.0), ("b", 2.0)):
        alarms.make(lambda name=name: rung.append(name)).set(delay)  # type: ignore[misc]
    time.now_s = 5.0
    alarms.ring()
    assert rung == ["a", "b", "c"]


@given(st.floats(0.1, 5), st.lists(st.floats(0, 20), max_size=20))
def test_a_repeated_alarm_keeps_its_beat_and_makes_up_for_nothing(
    period: float, waits: list[float]
) -> None:
    time, rung = Time(), []
    alarms = Alarms(time)
    alarms.make(lambda: rung.append(time.now_s)).repeat(period)
    for wait in waits:
        before, count = time.now_s, len(rung)
        time.now_s += wait
        alarms.ring()
        assert len(rung) - count <= 1
        if wait >= 1.001 * period:
            assert len(rung) == count + 1
        if wait < 0.999 * period - math.fmod(before, period):
            assert len(rung) == count
        assert 0.0 <= alarms.wait_s() <= 1.001 * period


def test_what_repeats_goes_on_when_it_is_asked_for_again() -> None:
    time, rung = Time(), []
    alarms = Alarms(time)
    alarm = alarms.make(lambda: rung.append(time.now_s))
    for _ in range(5):
        alarm.repeat(2.0)
        time.now_s += 1.0
        alarms.ring()
    assert rung == [2.0, 4.0]
    alarm.repeat(0.5)
    assert alarms.wait_s() == 0.5
    alarm.set(3.0)
    assert alarms.wait_s() == 3.0


def test_a_cancelled_alarm_is_silent() -> None:
    time, rung = Time(), []
    alarms = Alarms(time)
    once, often = (alarms.make(lambda: rung.append(1)) for _ in range(2))
    once.set(1.0)
    often.repeat(1.0)
    once.cancel()
    often.cancel()
    time.now_s = 10.0
    alarms.ring()
    assert rung == [] and alarms.wait_s() == math.inf


def test_a_callback_that_sets_its_alarm_anew_lets_others_ring_between() -> None:
    time, rung = Time(), []
    alarms = Alarms(time)

    def again() -> None:
        rung.append("again")
        eager.set(0.0)

    eager = alarms.make(again)
    patient = alarms.make(lambda: rung.append("patient"))
    eager.set(0.0)
    patient.set(1.0)
    for _ in range(3):
        time.now_s += 1.0
        alarms.ring()
    assert rung.count("again") == 3 and rung.count("patient") == 1


def test_an_alarm_cancelled_by_another_that_rings_at_once_is_silent() -> None:
    time, rung = Time(), []
    alarms = Alarms(time)
    first = alarms.make(lambda: second.cancel())
    second = alarms.make(lambda: rung.append(1))
    first.set(1.0)
    second.set(1.5)
    time.now_s = 2.0
    alarms.ring()
    assert rung == []

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The way through a step in wall time, with times made up."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.mission.run.step_scheduler import Pace

delays = st.floats(0, 20)
periods = st.sampled_from([0.0, 0.05, 1.0, 13.0, 1000.0])
changes = st.lists(st.tuples(delays, st.one_of(periods, st.booleans())), max_size=20)


@given(changes)
def test_whatever_changes_the_share_of_a_step_never_shrinks(
    happenings: list[tuple[float, float | bool]],
) -> None:
    pace, now, share = Pace(), 0.0, 0.0
    pace.begin(now, makes_up=0.0)
    for delay, change in happenings:
        now += delay
        if isinstance(change, bool):
            pace.hold(now, change)
        else:
            pace.set_period(now, change)
        assert share <= pace.share(now) <= 1.0
        share = pace.share(now)


@given(st.floats(0.01, 100), st.floats(0, 0.999))
def test_a_step_is_over_when_its_period_is(period: float, share: float) -> None:
    pace = Pace()
    pace.set_period(5.0, period)
    pace.begin(5.0, makes_up=0.0)
    now = 5.0 + share * period
    assert pace.share(now) == pytest.approx(share, abs=1e-6)
    assert pace.left_s(now) == pytest.approx((1 - share) * period, abs=1e-6)
    assert pace.share(5.0 + 2 * period) == 1.0
    assert pace.left_s(5.0 + 2 * period) == 0.0


@given(st.lists(st.floats(0, 0.9), min_size=1, max_size=50))
def test_steps_on_schedule_do_not_drift(lates: list[float]) -> None:
    pace = Pace()
    pace.set_period(0.0, 2.0)
    pace.begin(0.0, makes_up=0.0)
    now = 0.0
    for step, late in enumerate(lates, start=1):
        now = now + pace.left_s(now) + 2.0 * late
        assert now == pytest.approx(2.0 * (step + late))
        pace.begin(now, makes_up=1.0)


def test_a_delay_of_whole_steps_is_not_caught_up() -> None:
    pace = Pace()
    pace.set_period(0.0, 2.0)
    pace.begin(0.0, makes_up=1.0)
    pace.begin(7.0, makes_up=1.0)
    assert pace.left_s(7.0) == 2.0


def test_a_held_step_goes_on_from_where_it_was() -> None:
    pace = Pace()
    pace.set_period(0.0, 10.0)
    pace.begin(0.0, makes_up=0.0)
    pace.hold(4.0, True)
    assert pace.share(100.0) == pytest.approx(0.4)
    pace.hold(100.0, False)
    assert pace.left_s(103.0) == pytest.approx(3.0)


def test_without_a_period_nothing_is_waited_for() -> None:
    pace = Pace()
    pace.begin(1.0, makes_up=0.0)
    assert pace.left_s(1.0) == 0.0
    assert pace.share(50.0) == 0.0

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The table of states: who has a vehicle, and what may be sent to it."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.vehicles.control.orders import FlyMission, MakeReady, TakeOff
from dsse_ros.vehicles.fleet.custody import AIRBORNE, MAY_ORDER, NEXT, Custody, Event, next_custody

STARTS = (MakeReady, TakeOff, FlyMission)
EVENTS = st.lists(st.sampled_from(Event), max_size=12)


def reached(events: list[Event], custody: Custody = Custody.FREE) -> Custody:
    for event in events:
        custody = next_custody(custody, event)
    return custody


def test_every_state_has_its_row_in_both_tables() -> None:
    assert set(NEXT) == set(MAY_ORDER) == set(Custody)


def test_who_is_not_cleared_or_flown_gets_no_order() -> None:
    allowed = {custody for custody, orders in MAY_ORDER.items() if orders}
    assert allowed == {Custody.CLEARED, *AIRBORNE}


@given(EVENTS)
def test_nothing_is_armed_that_was_not_cleared_since_it_was_grounded(events: list[Event]) -> None:
    custody = Custody.FREE
    cleared = False
    for event in events:
        custody = next_custody(custody, event)
        cleared = cleared or event is Event.CLEAR
        if custody in (Custody.FREE, Custody.GROUNDED, Custody.TAKEN, Custody.FAILSAFE):
            cleared = False
        if any(order in MAY_ORDER[custody] for order in (MakeReady, TakeOff)):
            assert cleared


@given(EVENTS, st.sampled_from([Custody.TAKEN, Custody.FAILSAFE, Custody.GROUNDED]))
def test_who_was_taken_or_is_down_is_released_by_a_person_alone(
    events: list[Event], custody: Custody
) -> None:
    persons = (Event.CLEAR, Event.RELEASE, Event.COME_DOWN, Event.HOLD)
    # That two vehicles have its id means that nobody has taken it.
    without = [event for event in events if event not in (*persons, Event.DOUBLE)]
    on_the_ground = (Custody.GROUNDED, Custody.CRASHED)
    assert reached(without, custody) in (Custody.TAKEN, Custody.FAILSAFE, *on_the_ground)


@given(EVENTS, st.sampled_from(Custody))
def test_a_released_vehicle_waits_for_a_clearance_too(
    events: list[Event], custody: Custody
) -> None:
    if reached([*events, Event.RELEASE], custody) is Custody.RELEASED:
        assert not MAY_ORDER[Custody.RELEASED]


@given(st.sampled_from(Custody))
def test_after_an_operators_call_only_a_clearance_lets_it_move_on(custody: Custody) -> None:
    for call in (Event.HOLD, Event.COME_DOWN, Event.GROUND):
        after = next_custody(custody, call)
        moves = {Event.CLEAR, Event.HOLD, Event.COME_DOWN, Event.FALL, Event.DOUBLE}
        for event in set(Event) - moves:
            later = next_custody(after, event)
            orders = set(MAY_ORDER[later]) - set(MAY_ORDER[after])
            before = set(MAY_ORDER[custody])
            # What it may be ordered now it was ordered then, or its flight ends.
            assert later in (Custody.ENDING, Custody.FOLLOWING) or not orders - before


@given(st.sampled_from(sorted(AIRBORNE, key=str)))
def test_what_a_person_or_a_failsafe_does_counts_in_every_state_of_a_flight(
    custody: Custody,
) -> None:
    assert next_custody(custody, Event.TAKE_OVER) is Custody.TAKEN
    assert next_custody(custody, Event.FAILSAFE) is Custody.FAILSAFE
    assert next_custody(custody, Event.DOWN) in (Custody.GROUNDED, Custody.TAKEN)
    assert next_custody(custody, Event.HOLD) is Custody.HELD
    assert next_custody(custody, Event.FALL) is Custody.RECALLED


@given(st.sampled_from(Custody))
def test_an_operator_can_stop_a_vehicle_and_a_crash_is_one_in_every_state(
    custody: Custody,
) -> None:
    assert next_custody(custody, Event.COME_DOWN) is Custody.RECALLED
    assert next_custody(custody, Event.HOLD) is Custody.HELD
    assert next_custody(custody, Event.CRASH) is Custody.CRASHED

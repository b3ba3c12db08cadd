# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Invariants of every exchange, whatever is received and whenever."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from lossy_world import OURSELVES, Exchange
from message_values import changed
from mission_vehicle import VEHICLE, addressed
from sample_missions import mission

from dsse_ros.vehicles.autopilots import ARDUPILOT, PX4
from dsse_ros.vehicles.control.transfer import Timeouts
from dsse_ros.vehicles.control.upload import Download, Upload, VerifiedUpload
from dsse_ros.vehicles.mavlink.messages import (
    Address,
    MissionAck,
    MissionCount,
    MissionItemInt,
    MissionRequest,
    MissionRequestInt,
    MissionRequestList,
)

ITEMS = mission(1, 4)
TIMEOUTS = Timeouts()
EXCHANGES = {
    "upload to ArduPilot": lambda: Upload(ITEMS, VEHICLE, OURSELVES, autopilot=ARDUPILOT),
    "upload to PX4": lambda: Upload(ITEMS, VEHICLE, OURSELVES, autopilot=PX4),
    "verified upload to ArduPilot": lambda: VerifiedUpload(
        ITEMS, VEHICLE, OURSELVES, autopilot=ARDUPILOT
    ),
    "verified upload to PX4": lambda: VerifiedUpload(ITEMS, VEHICLE, OURSELVES, autopilot=PX4),
    "download": lambda: Download(VEHICLE, OURSELVES),
}
LONGEST_S = 4 * 4 * (2 * 16 * TIMEOUTS.reply_s + 4 * 2 * TIMEOUTS.stall_s + TIMEOUTS.stall_s)
"""Four uploads of four items and four downloads after each, all as slow as can be."""

SEQS = st.integers(0, 5) | st.integers(0, 65535)


def messages(target=OURSELVES, mission_type=0):
    """Messages of the protocol, sensible or not, that a vehicle may send."""
    return st.one_of(
        st.builds(MissionCount, *map(st.just, target), SEQS, st.just(mission_type)),
        st.builds(MissionRequest, *map(st.just, target), SEQS, st.just(mission_type)),
        st.builds(MissionRequestInt, *map(st.just, target), SEQS, st.just(mission_type)),
        st.builds(MissionAck, *map(st.just, target), st.integers(0, 20), st.just(mission_type)),
        st.builds(MissionRequestList, *map(st.just, target), st.just(mission_type)),
        st.sampled_from(ITEMS).map(
            lambda item: changed(addressed(item, target), mission_type=mission_type)
        ),
    )


ADDRESSES = st.builds(Address, st.integers(0, 255), st.integers(0, 255))
NOT_MESSAGES = st.one_of(
    st.none(), st.integers(), st.text(), st.binary(), st.tuples(st.integers()), st.builds(object)
)


class AnyExchange(RuleBasedStateMachine):
    """One exchange, with any sequence of events."""

    @initialize(name=st.sampled_from(sorted(EXCHANGES)))
    def begin(self, name: str) -> None:
        self.exchange: Exchange = EXCHANGES[name]()
        self.now = 0.0
        self.cancelled = False
        self.ended = None
        self.check(self.exchange.start(self.now))

    def check(self, sent) -> None:
        assert all((m.target_system, m.target_component) == VEHICLE for m in sent)
        assert all(message.mission_type == 0 for message in sent)
        items = [message for message in sent if isinstance(message, MissionItemInt)]
        assert all(item is ITEMS[item.seq] for item in items)
        assert not (items and self.cancelled), "an item was sent after the cancellation"
        if self.ended is not None:
            assert sent == [] and self.exchange.result == self.ended
        self.ended = self.exchange.result

    @rule(seconds=st.floats(0, 2))
    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.check(self.exchange.tick(self.now))

    @precondition(lambda self: self.exchange.deadline is not None)
    @rule()
    def wait_for_the_deadline(self) -> None:
        self.now = max(self.now, self.exchange.deadline)
        self.check(self.exchange.tick(self.now))

    @rule(message=messages())
    def receive(self, message) -> None:
        self.check(self.exchange.receive(message, VEHICLE, self.now))

    def is_ignored(self, message, sender, key) -> None:
        before, deadline = self.exchange.counts[key], self.exchange.deadline
        assert self.exchange.receive(message, sender, self.now) == []
        assert self.exchange.deadline == deadline
        assert self.exchange.counts[key] == before + (self.ended is None)

    @rule(message=messages(), sender=ADDRESSES.filter(lambda sender: sender != VEHICLE))
    def receive_from_another_sender(self, message, sender) -> None:
        self.is_ignored(message, sender, "wrong_sender")

    @rule(
        message=st.sampled_from(
            [Address(255, 190), Address(245, 190), Address(255, 191), Address(0, 1)]
        ).flatmap(messages)
    )
    def receive_for_another_target(self, message) -> None:
        self.is_ignored(message, VEHICLE, "wrong_target")

    @rule(message=st.integers(1, 255).flatmap(lambda kind: messages(mission_type=kind)))
    def receive_another_mission_type(self, message) -> None:
        self.is_ignored(message, VEHICLE, "wrong_mission_type")

    @rule(message=NOT_MESSAGES, sender=ADDRESSES | st.none())
    def receive_what_is_no_message(self, message, sender) -> None:
        self.is_ignored(message, sender, "unknown_message")

    @rule()
    def cancel(self) -> None:
        self.cancelled = True
        self.check(self.exchange.cancel(self.now))

    @invariant()
    def it_has_a_deadline_or_a_result(self) -> None:
        if hasattr(self, "exchange"):
            assert (self.exchange.result is None) == (self.exchange.deadline is not None)

    def teardown(self) -> None:
        if not hasattr(self, "exchange"):
            return
        self.cancel()
        end = self.now + TIMEOUTS.stall_s
        while self.exchange.result is None:
            self.wait_for_the_deadline()
            assert self.now <= end, "the cancelled exchange goes on"


TestAnyExchange = AnyExchange.TestCase
TestAnyExchange.settings = settings(max_examples=40, stateful_step_count=40, deadline=None)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXCHANGES)
@settings(max_examples=20)
@given(seed=st.integers(0, 2**32), gap_s=st.sampled_from([0.05, 0.3, 2.0]))
def test_an_exchange_ends_whatever_the_vehicle_sends(name, seed, gap_s):
    draw = random.Random(seed)
    exchange = EXCHANGES[name]()
    exchange.start(0.0)
    now = 0.0
    while exchange.result is None:
        now += gap_s
        assert now < LONGEST_S
        exchange.tick(now)
        message = draw.choice(
            [
                MissionRequest(*OURSELVES, draw.randrange(5)),
                MissionCount(*OURSELVES, draw.randrange(5)),
                addressed(draw.choice(ITEMS), OURSELVES),
                MissionAck(*OURSELVES, draw.choice([1, 13, 14])),
            ]
        )
        exchange.receive(message, VEHICLE, now)


@pytest.mark.parametrize("name", EXCHANGES)
def test_an_exchange_ends_without_a_reply(name):
    exchange = EXCHANGES[name]()
    exchange.start(0.0)
    now = 0.0
    while exchange.result is None:
        now = exchange.deadline
        exchange.tick(now)
    assert exchange.result.code == "no_reply"
    assert now <= 16 * TIMEOUTS.reply_s + TIMEOUTS.stall_s


def test_any_component_of_the_vehicle_is_a_sender_if_none_is_named():
    exchange = Download(Address(1, 0), OURSELVES)
    exchange.start(0.0)
    assert exchange.receive(MissionCount(*OURSELVES, 1), Address(1, 77), 0.0)
    assert exchange.counts["wrong_sender"] == 0


def test_a_broadcast_is_for_us():
    exchange = Download(VEHICLE, OURSELVES)
    exchange.start(0.0)
    assert exchange.receive(MissionCount(0, 0, 1), VEHICLE, 0.0)

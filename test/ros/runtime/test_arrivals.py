# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages keep the order of their arrival, whatever the clock and the middleware do."""

from __future__ import annotations

from dataclasses import dataclass, field

from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.ros.runtime.arrivals import Arrivals, MachineClocks
from dsse_ros.ros.runtime.polling import RawMessage

MS = 1_000_000
WALL_NS = 1_700_000_000_000_000_000
PERIOD = 50
"""Milliseconds from one call to the next; messages are taken for 3 ms."""


@dataclass
class Machine:
    """A machine whose wall clock steps, and messages that arrive on it.

    Attributes:
        steps: (when, by how much) the wall clock steps, in ms of the monotonic clock.
        arrivals: (when, topic, how long until it can be taken) of each message, in ms.
    """

    steps: list[tuple[int, int]]
    arrivals: list[tuple[int, int, int]]
    messages: list[RawMessage] = field(default_factory=list)

    def wall_ns(self, at: int) -> int:
        return WALL_NS + MS * (at + sum(by for when, by in self.steps if when <= at))

    def recorded(self) -> list[RawMessage]:
        """Take all messages, and one call more; return them in the order of `Arrivals`."""
        arrivals, found = Arrivals(), []
        self.messages = [
            RawMessage(f"/topic{topic}", b"", self.wall_ns(at), self.wall_ns(at), number)
            for number, (at, topic, _) in enumerate(self.arrivals)
        ]
        able: list[int] = []
        of_topic: dict[int, int] = {}
        for at, topic, held in self.arrivals:
            of_topic[topic] = max(at + held, of_topic.get(topic, 0))
            able.append(of_topic[topic])
        last, end = -PERIOD, max(able, default=0) + 2 * PERIOD
        for now in range(0, end, PERIOD):
            # A topic is taken from at another moment of the call each.
            taken = [
                message
                for message, (_, topic, _), ready in zip(
                    self.messages, self.arrivals, able, strict=True
                )
                if last + topic % 4 < ready <= now + topic % 4
            ]
            before = MachineClocks(self.wall_ns(now), MS * now)
            found += arrivals.order(taken, before, self.wall_ns(now + 3))
            last = now
        return found


times = st.integers(1, 400)
topics = st.integers(0, 5)


@given(
    steps=st.lists(st.tuples(times, st.integers(-5000, 5000)), max_size=3),
    arrivals=st.lists(st.tuples(times, topics, st.integers(0, 300)), max_size=25),
)
def test_every_message_comes_once_and_times_and_topics_never_go_back(
    steps: list[tuple[int, int]], arrivals: list[tuple[int, int, int]]
) -> None:
    machine = Machine(steps, sorted(arrivals))
    found = machine.recorded()
    assert sorted(message.sequence for message in found) == list(range(len(arrivals)))
    received = [message.received_ns for message in found]
    assert received == sorted(received)
    for topic in range(6):
        numbers = [message.sequence for message in found if message.topic == f"/topic{topic}"]
        assert numbers == sorted(numbers)
    assert all(message.published_ns <= message.received_ns for message in found)


@given(
    steps=st.lists(
        st.tuples(times, st.integers(-5000, -100) | st.integers(1, 5000)), max_size=3,
        unique_by=lambda step: step[0] // PERIOD,
    ),
    arrivals=st.lists(st.tuples(times, topics, st.just(0)), max_size=25, unique_by=lambda a: a[0]),
)  # fmt: skip
def test_the_order_is_that_of_arrival_however_far_the_clock_steps(
    steps: list[tuple[int, int]], arrivals: list[tuple[int, int, int]]
) -> None:
    found = Machine(steps, sorted(arrivals)).recorded()
    assert [message.sequence for message in found] == list(range(len(arrivals)))


@given(st.lists(st.tuples(times, topics, st.just(0)), max_size=25))
def test_times_are_those_of_the_middleware_while_the_clock_does_not_step_back(
    arrivals: list[tuple[int, int, int]],
) -> None:
    machine = Machine([(100, 2000)], sorted(arrivals))
    found = machine.recorded()
    assert sorted(found, key=lambda message: message.sequence) == machine.messages


def test_the_clocks_of_the_machine_are_read_together() -> None:
    offsets = [
        clocks.wall_ns - clocks.monotonic_ns
        for clocks in (MachineClocks.read(), MachineClocks.read())
    ]
    # As long as nobody sets the clock.
    assert abs(offsets[1] - offsets[0]) < 50 * MS

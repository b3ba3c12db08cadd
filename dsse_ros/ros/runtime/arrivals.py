# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The order in which messages of many topics arrived, by times that never go back.

The times at which the middleware received messages do not suffice. The wall clock may step back.
Fast DDS 3 (ROS 2 Kilted) states when a message was received, which is before it can be taken if an
earlier one of its publisher was lost on the way and must be sent again.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import NamedTuple

from dsse_ros.ros.runtime.polling import RawMessage

STEP_NS = 1_000_000
"""The wall clock has stepped back if it has lost more than this on the monotonic clock."""


class MachineClocks(NamedTuple):
    """The wall clock and the monotonic clock of the machine at the same time, in ns."""

    wall_ns: int
    monotonic_ns: int

    @classmethod
    def read(cls) -> MachineClocks:
        """Return the clocks as they are now."""
        readings = []
        for _ in range(3):
            before, wall, after = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
            readings.append((after - before, cls(wall, (before + after) // 2)))
        # The process may have been interrupted between two clocks.
        return min(readings)[1]


class Arrivals:
    """Puts taken messages into the order of their arrival.

    Their times become those of the wall clock, shifted by all its steps back. No message is put
    before one that was returned earlier, nor before an earlier one of its topic.

    Attributes:
        stepped_ns: Amount by which the wall clock stepped back before the last call; 0 if not.
    """

    def __init__(self) -> None:
        self.stepped_ns = 0
        self._shift_ns = 0
        self._offset_ns: int | None = None
        self._until_ns = 0
        self._last: dict[str, int] = {}
        self._waiting: list[RawMessage] = []

    def order(
        self, taken: Iterable[RawMessage], before: MachineClocks, after_ns: int
    ) -> list[RawMessage]:
        """Return the messages that arrived before a time, in order; later ones wait.

        Args:
            taken: Taken messages, those of a topic in the order in which they were taken.
            before: The clocks before any of them was taken.
            after_ns: The wall clock after all of them were taken.
        """
        self._note(before)
        until_ns = max(before.wall_ns + self._shift_ns, self._until_ns)
        for message in taken:
            self._waiting.append(self._placed(message, until_ns, after_ns))
        self._waiting.sort(key=lambda message: message.received_ns)
        # One that came during the call may have come before another that was not taken yet.
        ready = len(self._waiting)
        while ready and self._waiting[ready - 1].received_ns > until_ns:
            ready -= 1
        arrived, self._waiting = self._waiting[:ready], self._waiting[ready:]
        self._until_ns = until_ns
        return arrived

    def _note(self, clocks: MachineClocks) -> None:
        offset_ns = clocks.wall_ns - clocks.monotonic_ns
        lost_ns = 0 if self._offset_ns is None else self._offset_ns - offset_ns
        self.stepped_ns = lost_ns if lost_ns > STEP_NS else 0
        self._shift_ns += self.stepped_ns
        self._offset_ns = offset_ns

    def _placed(self, message: RawMessage, until_ns: int, after_ns: int) -> RawMessage:
        shift_ns = self._shift_ns
        if message.received_ns > after_ns:
            # Not by this clock, but by that before its step back.
            shift_ns -= self.stepped_ns
        received_ns = message.received_ns + shift_ns
        if received_ns > after_ns + self._shift_ns:
            received_ns = until_ns
        received_ns = max(received_ns, self._until_ns, self._last.get(message.topic, 0))
        self._last[message.topic] = received_ns
        published_ns = message.published_ns + shift_ns
        if message.published_ns <= message.received_ns:
            published_ns = min(published_ns, received_ns)
        return message._replace(received_ns=received_ns, published_ns=published_ns)

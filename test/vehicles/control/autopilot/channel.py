# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""One link of the vehicle: its codec and the rates at which it streams."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from .wire import Codec, Message


class Channel:
    """A link with numbers, signatures and streams of its own, as both autopilots have them.

    Args:
        codec: For this link alone.
        transmit: Takes the bytes of one frame.
        datagram: Whether bytes come in whole frames.

    Attributes:
        silent: While it is, nothing is sent or received.
        due_s: Vehicle time of the next message to stream.
    """

    def __init__(self, codec: Codec, transmit: Callable[[bytes], None], *, datagram: bool) -> None:
        self.codec = codec
        self.silent = False
        self.due_s = math.inf
        self._transmit = transmit
        self._datagram = datagram
        self._intervals: dict[int, float] = {}
        self._next: dict[int, float] = {}

    def send(self, message: Message) -> None:
        """Send a message."""
        data = self.codec.encode(message)
        if not self.silent:
            self._transmit(data)

    def messages(self, data: bytes) -> list[Message]:
        """Return the messages in what came in."""
        return [] if self.silent else self.codec.decode_all(data, datagram=self._datagram)

    def interval_s(self, message_id: int) -> float | None:
        """Seconds between two messages of a kind, None if it is not streamed."""
        return self._intervals.get(message_id)

    def stream(self, message_id: int, interval_s: float | None, now_s: float) -> None:
        """Send messages of a kind at an interval from now on, or no more."""
        self._intervals.pop(message_id, None)
        self._next.pop(message_id, None)
        if interval_s is not None:
            self._intervals[message_id] = interval_s
            self._next[message_id] = now_s
        self.due_s = min(self._next.values(), default=math.inf)

    def stream_only(self, intervals_s: Mapping[int, float], now_s: float) -> None:
        """Stream these and nothing else; what was streamed already keeps its phase."""
        self._next = {number: self._next.get(number, now_s) for number in intervals_s}
        self._intervals = dict(intervals_s)
        self.due_s = min(self._next.values(), default=math.inf)

    def take_due(self, now_s: float) -> list[int]:
        """Return the kinds of messages to send now."""
        taken = [number for number, due_s in self._next.items() if due_s <= now_s]
        for number in taken:
            interval_s = self._intervals[number]
            # The mean rate is the requested one, but no message is sent twice at once.
            self._next[number] = max(self._next[number] + interval_s, now_s)
        self.due_s = min(self._next.values(), default=math.inf)
        return taken


class Sender(NamedTuple):
    """Sender of a message, and its link."""

    channel: Channel
    system: int
    component: int

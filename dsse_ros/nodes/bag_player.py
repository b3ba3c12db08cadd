# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Publishes a bag again, at any rate, with the recorded quality of service."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.qos import HistoryPolicy, QoSProfile

from dsse_ros.recording.bag import Recorded, read_bag
from dsse_ros.recording.offered_qos import common, from_yaml
from dsse_ros.recording.schemas import message_class
from dsse_ros.runtime.exit_codes import fail
from dsse_ros.runtime.qos import RELIABLE
from dsse_ros.runtime.run_node import AlarmNode, run_node
from dsse_ros.search import FieldError

_DEPTH = 100
"""Depth of a publisher's history if the bag does not contain it, as with Fast DDS."""
_LARGE = 1 << 16
"""Size in bytes from which a publisher keeps only the last message."""
_BATCH_S = 0.02
"""Wall time after which other work gets its turn if the player is late."""
_ACKNOWLEDGED_S = 5.0
"""Wall time in which listeners must acknowledge the messages."""


class BagPlayer(AlarmNode):
    """Publishes the messages of a bag in order, at the intervals at which they were received.

    Args:
        path: The bag.
        rate: Factor on the speed.

    Raises:
        FieldError: If the bag cannot be read.
    """

    def __init__(self, path: Path, rate: float) -> None:
        super().__init__("replay")
        self._rate = rate
        self._messages: Iterator[Recorded] = read_bag(path)
        self._next: Recorded | None = None
        self._publishers_of: dict[str, Publisher | None] = {}
        self.failure: FieldError | None = None
        self.published = 0
        self._alarm = self.alarms.make(self._publish_due)
        self._advance()
        self._begun_s = time.monotonic()
        self._begun_ns = self._next.log_time_ns if self._next else 0
        self.get_logger().info(f"publishing {path} at {rate:g} times the recorded speed")
        self._alarm.set(0.0)

    def _advance(self) -> None:
        self._next = next(self._messages, None)

    def _publish_due(self) -> None:
        """Publish the messages that are due, and set the alarm for the next one."""
        until_s = time.monotonic() + _BATCH_S
        try:
            while self._next is not None:
                now_s = time.monotonic()
                wait_s = self._due_s(self._next) - now_s
                if wait_s > 0 or now_s > until_s:
                    self._alarm.set(max(wait_s, 0.0))
                    return
                self._publish(self._next)
                self._advance()
        except FieldError as error:
            self.failure = error
        self._end()

    def _due_s(self, message: Recorded) -> float:
        return self._begun_s + (message.log_time_ns - self._begun_ns) / 1e9 / self._rate

    def _publish(self, message: Recorded) -> None:
        if message.topic not in self._publishers_of:
            self._publishers_of[message.topic] = self._make(message)
        publisher = self._publishers_of[message.topic]
        if publisher is not None:
            publisher.publish(message.data)
            self.published += 1

    def _make(self, message: Recorded) -> Publisher | None:
        """Return a publisher for the topic of a message, None if its type is not installed."""
        try:
            kind = message_class(message.type_name)
        except FieldError as error:
            self.get_logger().warning(f"{message.topic} is left out: {error}")
            return None
        depth = 1 if len(message.data) > _LARGE else _DEPTH
        return self.create_publisher(kind, message.topic, _profile(message.offered_qos, depth))

    def _end(self) -> None:
        deadline_s = time.monotonic() + _ACKNOWLEDGED_S
        for publisher in filter(None, self._publishers_of.values()):
            left_s = max(deadline_s - time.monotonic(), 0.0)
            publisher.wait_for_all_acked(Duration(seconds=left_s))
        if self.failure is None:
            self.get_logger().info(f"{self.published} messages published")
        self.finished = True


def _profile(offered_qos: str, depth: int) -> QoSProfile:
    """Return the QoS to offer for the QoS that was offered at the recording.

    Args:
        offered_qos: The recorded QoS, as in the bag.
        depth: Depth of the history if the bag does not contain it.
    """
    try:
        offered = from_yaml(offered_qos)
    except ValueError:
        offered = []
    if not offered:
        return RELIABLE
    known = [one.depth for one in offered if one.history == HistoryPolicy.KEEP_LAST]
    return common(offered, max(known, default=depth))


def play(path: Path, rate: float, ros: Sequence[str]) -> int:
    """Publish a bag until its end or until it is interrupted; returns the exit code.

    Args:
        path: The bag.
        rate: Factor on the speed, more than 0.
        ros: ROS arguments.
    """
    if not (rate > 0 and math.isfinite(rate)):
        return fail("replay", f"--play must be a number > 0, got {rate:g}")
    players: list[BagPlayer] = []

    def make() -> BagPlayer:
        players.append(BagPlayer(path, rate))
        return players[0]

    code = run_node("replay", make, ["--ros-args", *ros] if ros else [])
    failure = players[0].failure if players else None
    return fail("replay", failure) if failure is not None else code

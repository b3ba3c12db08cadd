# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros recorder`: writes all topics of a mission to a bag."""

from __future__ import annotations

import os
import sys
import time

from dsse_ros.mission.recording.bag import BagWriter
from dsse_ros.mission.recording.missed import Missed
from dsse_ros.mission.recording.offered_qos import to_yaml
from dsse_ros.ros.nodes.raw_topics import RawTopics
from dsse_ros.ros.nodes.settings import RecorderSettings
from dsse_ros.ros.runtime.polling import RawMessage
from dsse_ros.ros.runtime.qos import read_settings
from dsse_ros.ros.runtime.run_node import AlarmNode, run_node

_NICENESS = 5
"""Niceness of the process: on a busy machine, the mission comes first. With 10, a third of the
messages of latched topics was lost on two cores with a load of 18; with 5 none was."""
DISCOVERY_PERIOD_S = 0.2
TAKE_PERIOD_S = 0.05
FLUSH_PERIOD_S = 1.0
"""Wall time after which what was received outlasts the end of the process."""


class RecorderNode(AlarmNode):
    """Writes the topics of its namespace to a bag, until the node ends.

    Attributes:
        failed: Whether the bag could not be written to its end.

    Raises:
        FieldError: If a parameter is not allowed, or the file cannot be written.
    """

    def __init__(self) -> None:
        super().__init__("recorder")
        self.settings, endpoints = read_settings(self, RecorderSettings)
        endpoints.check_all_used()
        name = self.settings.bag or time.strftime("mission_%Y_%m_%d-%H_%M_%S.mcap")
        self.path = os.path.abspath(name)
        # None once it is closed, or could not be written to its end.
        self._bag: BagWriter | None = BagWriter(self.path)
        self._topics = RawTopics(self, self.warn, self.settings.exclude)
        self._channels: dict[str, int] = {}
        self.messages = 0
        self._missed = Missed()
        for ending in (self._topics.destroy, self._close, self._take):
            self.at_end(ending)
        self.get_logger().info(f"recording {self.get_namespace()} to {self.path}")
        self.alarms.make(self._discover).repeat(DISCOVERY_PERIOD_S)
        self.alarms.make(self._take).repeat(TAKE_PERIOD_S)
        self.alarms.make(self._flush).repeat(FLUSH_PERIOD_S)
        self._discover()

    def _discover(self) -> None:
        for topic in self._topics.discover():
            self.debug(lambda topic=topic: f"recording {topic}")  # type: ignore[misc]

    def _take(self) -> None:
        """Write the new messages."""
        if self._bag is None:
            return
        try:
            for message in self._topics.take():
                self._write(self._bag, message)
        except OSError as error:
            self._fail(error)

    def _write(self, bag: BagWriter, message: RawMessage) -> None:
        channel = self._channels.get(message.topic)
        if channel is None:
            # The QoS of the publisher is certain only once it has sent a message.
            offers = self._topics.offers(message.topic)
            channel = self._channels[message.topic] = bag.add_topic(
                message.topic,
                self._topics.types[message.topic],
                to_yaml([offer.qos_profile for offer in offers]),
                str(offers[0].topic_type_hash) if offers else "",
            )
        bag.write(
            channel,
            message.data,
            log_time_ns=message.received_ns,
            publish_time_ns=message.published_ns,
            sequence=message.sequence,
        )
        self.messages += 1
        self._missed.note(message.topic, message.sequence, message.published_ns)

    def _flush(self) -> None:
        for topic in self._channels:
            if self._topics.num_publishers(topic) > 1:
                self._missed.leave_out(topic)
        if self._bag is not None:
            try:
                self._bag.flush()
            except OSError as error:
                self._fail(error)

    def _fail(self, error: OSError) -> None:
        """End the recording, but not the mission."""
        assert self._bag is not None
        self._bag.abandon()
        self._bag = None
        self.failed = self.finished = True
        self.get_logger().error(
            f"the recording has ended: {self.path}: {error.strerror}; "
            "everything written before can be read"
        )

    def _close(self) -> None:
        bag = self._bag
        if bag is None:
            return
        try:
            bag.close()
        except OSError as error:
            self._fail(error)
        else:
            self._bag = None
            self.get_logger().info(
                f"{self.messages} messages on {len(self._channels)} topics in {self.path}"
            )
            if self._missed.line:
                self.get_logger().warning(self._missed.line)


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; returns the exit code.

    It is 2 for bad input, 3 where the bag could not be written to its end.
    """

    def make() -> RecorderNode:
        # Set it before the node: threads inherit it, and DDS starts its threads with the node.
        os.nice(_NICENESS)
        return RecorderNode()

    return run_node("recorder", make, argv)


if __name__ == "__main__":
    sys.exit(main())

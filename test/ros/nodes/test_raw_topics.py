# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Topics that come, go, and come again while they are discovered."""

from __future__ import annotations

import rclpy
from rig import Rig
from std_msgs.msg import Int32

from dsse_ros.ros.nodes.raw_topics import RawTopics


def test_a_topic_that_nobody_was_on_is_subscribed_once_somebody_is(rig: Rig) -> None:
    listener = rclpy.create_node("listener", namespace="/heard", context=rig.context)
    talker = rclpy.create_node("talker", context=rig.context)
    topics = RawTopics(listener, lambda kind, line: None)
    # As if they had gone between two questions about it.
    topics.types["/heard/number"] = "std_msgs/msg/Int32"
    assert not topics.subscribe("/heard/number")
    talker.create_publisher(Int32, "/heard/number", 1)

    def is_subscribed() -> bool:
        topics.discover()
        return topics.is_subscribed("/heard/number")

    rig.until(is_subscribed, "a subscription")
    topics.destroy()
    for node in (listener, talker):
        node.destroy_node()

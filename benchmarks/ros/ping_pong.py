# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bare rclpy instead of `sim_node`: answers each joint action with the messages of a step.

The messages are ready-made: the program has no drones, worlds or maps.
"""

from __future__ import annotations

import base64
import json
import struct
import sys
import time
from pathlib import Path
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_msgs.msg import Int32MultiArray

from benchmarks.ros.peer import REPORT, STEP_AT, message_type, profile_of
from dsse_ros.ros.runtime.qos import RELIABLE
from dsse_ros.ros.runtime.run_node import new_executor

NAME = "ping_pong"
# Messages that sim_node sends after the report of a step.
AFTER_THE_REPORT = ("/odom", "/tf")


class PingPong(Node):
    """Sends the messages of `capture`: those of a step together, others at their rate.

    Args:
        topics: What `capture` wrote.
        steps: Steps of a mission; the next one starts automatically.
    """

    def __init__(self, topics: list[dict[str, Any]], steps: int) -> None:
        super().__init__(NAME, start_parameter_services=False)
        self._steps = steps
        self._step = 0
        self._round: list[tuple[Any, Any]] = []
        self._others: list[list[Any]] = []
        for topic in sorted(topics, key=lambda t: _order(t["topic"])):
            kind = message_type(topic["type"])
            publisher = self.create_publisher(
                kind, topic["topic"], profile_of(topic["reliability"], topic["durability"])
            )
            message = deserialize_message(base64.b64decode(topic["message"]), kind)
            if topic["topic"] == REPORT:
                self._report = message
            if topic["per_step"]:
                self._round.append((publisher, message))
            else:
                self._others.append([publisher, message, 1 / topic["rate"], 0.0])
        self.create_subscription(Int32MultiArray, "joint_action", self._on_action, RELIABLE)
        self._publish(0)

    def _on_action(self, message: Int32MultiArray) -> None:
        if message.data[1] != self._step:
            return
        self._publish(self._step + 1)
        if self._step == self._steps:
            self._publish(0)

    def _publish(self, step: int) -> None:
        self._step = step
        struct.pack_into("<I", self._report.data, STEP_AT, step)
        for publisher, message in self._round:
            publisher.publish(message)
        # Faster than a timer, which would also slow the loop below.
        now = time.monotonic()
        for other in self._others:
            publisher, message, period, due = other
            if now >= due:
                other[3] = now + period
                publisher.publish(message)


def _order(topic: str) -> int:
    return 1 if topic == REPORT else 2 if topic.endswith(AFTER_THE_REPORT) else 0


def main(recording: str, steps: str) -> None:
    """Answer until killed."""
    rclpy.init()
    executor = new_executor()
    executor.add_node(PingPong(json.loads(Path(recording).read_text()), int(steps)))
    # As in sim_node, see `dsse_ros.ros.runtime.run_node`.
    while rclpy.ok():
        executor.spin_once(timeout_sec=0.1)


if __name__ == "__main__":
    main(*sys.argv[1:])

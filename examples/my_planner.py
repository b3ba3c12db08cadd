# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""An example planner that uses only topics: start `sim_node`, then this.

Each drone has its own columns; it flies to the best cell in them and searches there.
"""

import contextlib
from functools import partial
from typing import Any

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import String

from msg_adapters.images import image_to_probability
from msg_adapters.step_report import step_report_from_message


def choose(drone: Any, columns: np.ndarray, probability: np.ndarray) -> str:
    """Return the action that brings a drone closer to the best cell of its columns."""
    row, nth = divmod(int(probability[:, columns].argmax()), len(columns))
    east, south = columns[nth] - drone["col"], row - drone["row"]
    if east:
        return "right" if east > 0 else "left"
    if south:
        return "down" if south > 0 else "up"
    return "search"


class MyPlanner(Node):
    """Answers every step with one command per drone in flight."""

    def __init__(self) -> None:
        super().__init__("my_planner")
        self.received: dict[str, Any] = {}
        self.answered = None
        self.commands: list[Any] = []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for kind, topic in ((Image, "probability"), (PointCloud2, "step_report")):
            self.create_subscription(
                kind, topic, partial(self.received.__setitem__, topic), latched
            )
        self.create_timer(0.01, self.answer)

    def answer(self) -> None:
        """Command the drones once per step, when both its map and its report have arrived."""
        image, report = self.received.get("probability"), self.received.get("step_report")
        if not image or not report or image.header.stamp != report.header.stamp:
            return
        drones, probability = step_report_from_message(report), image_to_probability(image)
        for i in range(len(self.commands), len(drones)):
            self.commands.append(self.create_publisher(String, f"drone{i}/cmd_action_name", 10))
        subscribed = all(command.get_subscription_count() for command in self.commands)
        if report is self.answered or not subscribed:
            return
        self.answered = report
        shares = np.array_split(np.arange(probability.shape[1]), len(drones))
        for drone, columns, command in zip(drones, shares, self.commands, strict=True):
            if not drone["terminated"] and not drone["truncated"]:
                command.publish(String(data=choose(drone, columns, probability)))


if __name__ == "__main__":
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(MyPlanner())

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Logs what a step of `sim_node` waits for, and why commands may be missing."""

from __future__ import annotations

import time

from rclpy.node import Node

from dsse_ros.mission.run import status
from dsse_ros.mission.run.mission import Mission

REMINDER_S = 10.0
"""Wall time after which it is logged again that commands are missing."""


class WaitingLog:
    """Logs once what a step waits for, and repeats it while commands are missing.

    Args:
        node: Node that logs, and looks for publishers.
        mission: The mission.

    Attributes:
        topics: The topics of commands.
    """

    def __init__(self, node: Node, mission: Mission) -> None:
        self._node = node
        self._mission = mission
        self._due_s = 0.0
        self.topics: list[str] = []

    def log(self, awaited: str, *, first: bool) -> None:
        """Log what a step waits for, if it is due.

        Args:
            awaited: What it waits for; empty for nothing.
            first: Whether this step has not waited before.
        """
        now_s, missing = time.monotonic(), self._mission.missing
        if not awaited or not (first or (missing and now_s >= self._due_s)):
            return
        self._due_s = now_s + REMINDER_S
        if missing:
            awaited += f": {self._reasons()}"
        self._node.get_logger().info(f"step {self._mission.result.step}: {awaited}")

    def _reasons(self) -> str:
        node = self._node
        counts = {
            topic: node.count_publishers(node.resolve_topic_name(topic)) for topic in self.topics
        }
        of_all = [topic for topic in self.topics if "/" not in topic]
        return status.reasons_without_commands(self._mission, counts, of_all)

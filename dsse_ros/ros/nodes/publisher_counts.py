# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Counts the publishers of topics that only one node should publish."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from rclpy.node import Node

from dsse_ros.ros.nodes.settings import SimSettings
from dsse_ros.vehicles.fleet.vehicle_time import IGNORED


class PublisherCounts:
    """Counts the publishers of topics, and warns of each additional one.

    Args:
        node: Node that looks for publishers.
        consequences: By topic, the consequence of more than one publisher.

    Attributes:
        last: The counts of the last update.
    """

    def __init__(self, node: Node, consequences: Mapping[str, str]) -> None:
        self._node = node
        self._consequences = consequences
        self.last: Counter[str] = Counter()

    def update(self) -> Counter[str]:
        """Count the publishers of each topic, and warn of new ones."""
        node = self._node
        counts = Counter(
            {topic: node.count_publishers(node.resolve_topic_name(topic))
             for topic in self._consequences}
        )  # fmt: skip
        for topic, count in counts.items():
            if count > max(self.last[topic], 1):
                text = f"{count} nodes publish {topic}: {self._consequences[topic]}"
                node.get_logger().warning(f"{text} (a killed node counts for some seconds more)")
        self.last = counts
        return counts


def consequences(settings: SimSettings, joint: str) -> dict[str, str]:
    """Return the consequence of more than one publisher, by topic.

    Args:
        settings: The settings.
        joint: The topic that commands all drones.
    """
    found = {
        "step_report": "listeners receive all missions mixed; give each its own namespace",
        joint: "the last command of a drone before a step wins",
    }
    if settings.publish_clock:
        found["/clock"] = "time jumps to and fro; only one may have publish_clock"
    if settings.vehicle_time != IGNORED:
        found["drone0/vehicle_state"] = "two bridges would fly the same vehicles; stop one"
    return found

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dsse_ros cot_gateway`: sends a search as Cursor on Target, for ATAK and its kin."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseArray
from sensor_msgs.msg import Image, NavSatFix
from std_msgs.msg import String

from dsse_ros.ros.runtime.qos import read_settings
from dsse_ros.ros.runtime.run_node import AlarmNode, run_node
from dsse_ros.screens.tak.picture import CotPicture
from dsse_ros.screens.tak.sender import CotSender
from dsse_ros.screens.tak.settings import CotSettings
from dsse_ros.world.scenario.agents import agents_from_json
from dsse_ros.world.scenario.live_texts import contacts_from_json
from msg_adapters.images import image_to_probability


class CotNode(AlarmNode):
    """Sends drones, contacts and the smallest areas of the POC.

    Raises:
        FieldError: If a parameter is not allowed.
    """

    def __init__(self) -> None:
        super().__init__("cot_gateway")
        self.settings, self._endpoints = read_settings(self, CotSettings)
        self._picture = CotPicture()
        # A map may come before the description of its search.
        self._map: Image | None = None
        self._has_belief = False
        self._vehicles: set[str] = set()
        takes: dict[str, Callable[[Any], None]] = {
            "agents": self._on_agents,
            "drones": self._on_drones,
            "live/contacts": self._on_contacts,
            "belief": self._on_belief,
            "probability": self._on_probability,
        }
        for topic, take in takes.items():
            self._endpoints.subscription(topic, take)
        self._endpoints.check_all_used(later="vehicle_fix")
        self._sender = CotSender(self.settings.of_pytak, self._report)
        self.at_end(self._sender.close)
        self.get_logger().info(f"sending {self.get_namespace()} to {self.settings.url}")
        self.alarms.make(self.isolated("events", self._send)).repeat(self.settings.period)

    def _report(self, line: str) -> None:
        if self.context.ok():
            self.get_logger().warning(f"{self.settings.url}: {line}")

    def _on_agents(self, message: String) -> None:
        info = agents_from_json(message.data, with_definition=False)
        if self._picture.info is not None and self._picture.info.run_id != info.run_id:
            self._has_belief = False
        self._picture.begin(info)
        for name in info.agents:
            if name not in self._vehicles:
                self._vehicles.add(name)
                self._endpoints.subscription(f"{name}/vehicle_fix", partial(self._on_fix, name))

    def _on_drones(self, message: PoseArray) -> None:
        places = [(pose.position.x, pose.position.y, pose.position.z) for pose in message.poses]
        if not all(math.isfinite(value) for place in places for value in place):
            raise ValueError("positions must be finite")
        self._picture.put_drones(places)

    def _on_fix(self, drone: str, message: NavSatFix) -> None:
        place = (message.latitude, message.longitude, message.altitude)
        if all(map(math.isfinite, place)):
            self._picture.put_vehicle(drone, place, time.monotonic())

    def _on_contacts(self, message: String) -> None:
        self._picture.put_contacts(contacts_from_json(message.data))

    def _on_belief(self, message: Image) -> None:
        self._map, self._has_belief = message, True

    def _on_probability(self, message: Image) -> None:
        # What looks have not found is in the belief alone.
        if not self._has_belief:
            self._map = message

    def _send(self) -> None:
        if self._map is not None and self._picture.info is not None:
            poc, self._map = image_to_probability(self._map), None
            self._picture.put_poc(poc)
        self._sender.send(self._picture.events(time.monotonic()))


def main(argv: list[str] | None = None) -> int:
    """Run the node until it is interrupted; returns the exit code, 2 for bad input."""
    return run_node("cot_gateway", CotNode, argv)


if __name__ == "__main__":
    sys.exit(main())

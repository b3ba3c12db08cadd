# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The health of a node, and of its drones or vehicles, on `/diagnostics`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock

from dsse_ros.ros.runtime.qos import Endpoints
from dsse_ros.ros.runtime.run_node import AlarmNode
from msg_adapters.diagnostics import Level, diagnostic_array, diagnostic_status, status_name

PERIOD_S = 1.0
"""Wall time between diagnostics."""


class NodeDiagnostics:
    """Publishes the health of a node.

    Args:
        node: The node.
        endpoints: Makes its publisher.
    """

    def __init__(self, node: AlarmNode, endpoints: Endpoints) -> None:
        self._node = node
        self._publisher = endpoints.publisher("/diagnostics")
        # Monitors compare the stamps with the wall clock.
        self._clock = Clock()

    def name_of(self, drone: str = "") -> str:
        """Return the name of the status of the node, or of one of its drones."""
        return status_name(self._node.get_fully_qualified_name(), drone)

    def publish(
        self,
        health: tuple[Level, str],
        values: Mapping[str, object],
        drones: Iterable[DiagnosticStatus] = (),
    ) -> None:
        """Publish the health of the node and of its drones.

        Args:
            health: Level and line of the node.
            values: Its values.
            drones: Statuses of its drones, with names by `name_of`.
        """
        own = diagnostic_status(self.name_of(), *health, values)
        self._publisher.publish(diagnostic_array(self._clock.now().to_msg(), own, *drones))

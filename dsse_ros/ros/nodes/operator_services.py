# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The operator services of `mavlink_bridge`, and how to find a bridge that serves them.

The services for all vehicles belong to the node, such as `~/hold`. Those for one vehicle, such as
`drone0/hold`, are beside its topics.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_srvs.srv import SetBool, Trigger

OPERATOR_SERVICES: Mapping[str, Any] = MappingProxyType(
    {"arm": SetBool, "hold": Trigger, "return": Trigger, "land": Trigger}
)
"""Types by name."""

_STATES = re.compile(r"(?P<namespace>.*)/(?P<drone>drone\d+)/vehicle_state")


@dataclass(frozen=True)
class FoundBridge:
    """A running bridge.

    Attributes:
        node: Full name of its node.
        drones: Names of the drones that have a vehicle, in order.
    """

    node: str
    drones: tuple[str, ...]


def full_name(endpoint: TopicEndpointInfo) -> str:
    """Return the full name of the node of a publisher."""
    return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"


def find_bridges(node: Node) -> dict[str, FoundBridge]:
    """Return the running bridges by namespace, "" for the root.

    Args:
        node: Node that looks for them.
    """
    found: dict[str, tuple[str, list[str]]] = {}
    for topic, _ in node.get_topic_names_and_types():
        match = _STATES.fullmatch(topic)
        publishers = node.get_publishers_info_by_topic(topic) if match else []
        if match and publishers:
            node_of = full_name(publishers[0])
            _, drones = found.setdefault(match["namespace"], (node_of, []))
            drones.append(match["drone"])
    return {
        namespace: FoundBridge(name, tuple(sorted(drones, key=lambda drone: int(drone[5:]))))
        for namespace, (name, drones) in found.items()
    }


def service_name(namespace: str, bridge: FoundBridge, drone: str, what: str) -> str:
    """Return the full name of a service.

    Args:
        namespace: Namespace of the bridge, "" for the root.
        bridge: The bridge.
        drone: Name of the drone, empty for all.
        what: One of `OPERATOR_SERVICES`.
    """
    return f"{namespace}/{drone}/{what}" if drone else f"{bridge.node}/{what}"

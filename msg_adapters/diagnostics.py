# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state of a node as diagnostic_msgs/DiagnosticArray."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from msg_adapters.stamps import header

Level = Literal["ok", "warning", "error", "stale"]
_LEVELS = {
    "ok": DiagnosticStatus.OK,
    "warning": DiagnosticStatus.WARN,
    "error": DiagnosticStatus.ERROR,
    "stale": DiagnosticStatus.STALE,
}


_PREFIX = "dsse_ros: "
"""Start of the names on /diagnostics, by which aggregators group them."""

OF_OBJECT = "object."
"""Start of the keys of what the object of an incident may be."""


def status_name(node: str, drone: str = "") -> str:
    """Return the name on /diagnostics of the status of a node, or of one of its drones.

    Args:
        node: Fully qualified name of the node.
        drone: Name of the drone.
    """
    return ": ".join(filter(None, [f"{_PREFIX}{node.lstrip('/')}", drone]))


def node_of_status(name: str) -> str:
    """Return the fully qualified name of the node of a status; empty if it is of anything else."""
    node = name.removeprefix(_PREFIX)
    return "" if node == name or ": " in node else f"/{node}"


def diagnostic_status(
    name: str,
    level: Level,
    message: str,
    values: Mapping[str, object],
    hardware_id: str = "dsse_ros",
) -> DiagnosticStatus:
    """Return a status.

    Args:
        name: What the status is of.
        level: Level of the status.
        message: One line.
        values: Anything worth knowing, in this order; made text by `str`.
        hardware_id: Which device it is.
    """
    status = DiagnosticStatus(
        level=_LEVELS[level], name=name, message=message, hardware_id=hardware_id
    )
    status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return status


def diagnostic_array(stamp: Time, *statuses: DiagnosticStatus) -> DiagnosticArray:
    """Return statuses of the same time."""
    return DiagnosticArray(header=header("", stamp), status=list(statuses))

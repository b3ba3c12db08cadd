# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state of a node as diagnostic_msgs/DiagnosticArray."""

from __future__ import annotations

from collections.abc import Mapping

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from msg_adapters.stamps import header


def diagnostic_array(
    stamp: Time,
    *,
    name: str,
    hardware_id: str,
    level: bytes,
    message: str,
    values: Mapping[str, object],
) -> DiagnosticArray:
    """Return one status in an array.

    Args:
        stamp: Time of the status.
        name: What the status is of.
        hardware_id: Which one of these.
        level: One of the constants DiagnosticStatus.OK, WARN, ERROR and STALE, which are bytes.
        message: One line.
        values: Anything worth knowing, in this order; made text by `str`.
    """
    status = DiagnosticStatus(level=level, name=name, message=message, hardware_id=hardware_id)
    status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return DiagnosticArray(header=header("", stamp), status=[status])

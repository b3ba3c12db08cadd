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


def diagnostic_array(
    stamp: Time,
    *,
    name: str,
    level: Level,
    message: str,
    values: Mapping[str, object],
    hardware_id: str = "dsse_ros",
) -> DiagnosticArray:
    """Return one status in an array.

    Args:
        stamp: Time of the status.
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
    return DiagnosticArray(header=header("", stamp), status=[status])

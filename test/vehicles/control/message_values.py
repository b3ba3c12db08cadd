# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""pymavlink's messages as values: made of some fields, with some changed, and compared."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from dsse_ros.vehicles.mavlink.messages import MissionItemInt


def with_fields(kind: Any, **fields: Any) -> Any:
    """Return a message with these fields; the others are 0."""
    return kind(**dict.fromkeys(kind.fieldnames, 0) | fields)


def changed(message: Any, **fields: Any) -> Any:
    """Return a copy of a message with other values of these fields."""
    before = {name: getattr(message, name) for name in message.fieldnames}
    return type(message)(**before | fields)


def item_int(seq: int, frame: int, command: int, **fields: Any) -> Any:
    """Return an item for system 1, component 1."""
    numbers = dict.fromkeys(("param1", "param2", "param3", "param4", "z"), 0.0)
    fields = {"target_system": 1, "target_component": 1, "autocontinue": 1, **numbers, **fields}
    return with_fields(MissionItemInt, seq=seq, frame=frame, command=command, **fields)


def texts(messages: Iterable[Any]) -> list[str]:
    """Return messages as texts: NaN is equal to NaN, and how they were sent does not count."""
    return [str(message) for message in messages]


def contents(items: Iterable[Any]) -> list[str]:
    """Return items as texts without their targets."""
    return texts(changed(item, target_system=0, target_component=0) for item in items)

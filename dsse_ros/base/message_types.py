# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Message types by their names in ROS."""

from __future__ import annotations

import importlib
import re
from functools import cache
from typing import Any

from dsse_ros.base.fields import FieldError

_NAME = re.compile(r"(\w+)/msg/(\w+)")


@cache
def message_class(type_name: str) -> Any:
    """Return the class of a message type, such as `std_msgs/msg/String`.

    Raises:
        FieldError: If the type is not installed.
    """
    package, name = parts_of(type_name)
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        raise not_installed(type_name) from None


def parts_of(type_name: str) -> tuple[str, str]:
    """Return the package and the name of a message type.

    Raises:
        FieldError: If it is not a name of a message type.
    """
    match = _NAME.fullmatch(type_name)
    if match is None:
        raise FieldError(f"type must be package/msg/Name, got {type_name!r}")
    return match[1], match[2]


def not_installed(type_name: str) -> FieldError:
    """Return the error for a type that is not installed."""
    return FieldError(f"type must be installed, got {type_name!r}; source the ROS 2 that has it")

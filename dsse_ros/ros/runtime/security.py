# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""If DDS security is requested, the program starts with it or not at all.

ROS 2 itself starts unprotected if the environment is misspelt, if the keys are missing and the
strategy is not Enforce, or if a middleware does not know these variables (design.ros2.org, "ROS 2
Robotic Systems Threat Model" and "ROS 2 DDS-Security integration").
"""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping

from dsse_ros.base.fields import FieldError

ENABLE, STRATEGY, KEYSTORE = (f"ROS_SECURITY_{name}" for name in ("ENABLE", "STRATEGY", "KEYSTORE"))

_ENFORCE = "Enforce"
_ALLOWED = {ENABLE: ("true", "false", ""), STRATEGY: (_ENFORCE, "Permissive", "")}
"""Values that rcl knows, letter by letter; it treats any other value as no."""
_ENFORCING = (
    "rmw_fastrtps_cpp",
    "rmw_fastrtps_dynamic_cpp",
    "rmw_cyclonedds_cpp",
    "rmw_connextdds",
)
"""Middlewares that refuse to start unprotected if the strategy is Enforce."""
_WITHOUT = ("have the security libraries", "have security support")
"""What Fast DDS and Cyclone DDS report if they were built without security."""


def is_asked_for(environment: Mapping[str, str]) -> bool:
    """Return whether an environment requests DDS security.

    Raises:
        FieldError: If it has a value that ROS 2 would treat as no.
    """
    for name, allowed in _ALLOWED.items():
        if (value := environment.get(name, "")) not in allowed:
            raise FieldError(f"{name} must be {' or '.join(allowed[:2])}, got {value!r}")
    return environment.get(ENABLE) == "true"


def enforce(environment: MutableMapping[str, str]) -> bool:
    """Make ROS 2 refuse to start unprotected if the environment requests security.

    Call it before rclpy starts, with the environment of the process. Returns whether the
    environment requests security.

    Raises:
        FieldError: If it names no keys, or has a value that ROS 2 would treat as no.
    """
    if not is_asked_for(environment):
        return False
    if not environment.get(KEYSTORE):
        raise FieldError(f"{KEYSTORE} must be the folder of the keys with {ENABLE}=true, got none")
    environment[STRATEGY] = _ENFORCE
    return True


def check_middleware(environment: Mapping[str, str], middleware: str) -> None:
    """Refuse a middleware that would start unprotected anyway.

    Args:
        environment: Environment of the process.
        middleware: Name of the ROS middleware.

    Raises:
        FieldError: If the environment requests security and the middleware ignores that.
    """
    if is_asked_for(environment) and middleware not in _ENFORCING:
        raise FieldError(
            f"RMW_IMPLEMENTATION must be one of {', '.join(_ENFORCING)} with {ENABLE}=true, "
            f"got {middleware!r}"
        )


def explained(error: str, middleware: str) -> str:
    """Return an error of ROS 2, explained if the DDS was built without security."""
    if any(text in error for text in _WITHOUT):
        return (
            f"{ENABLE} must be false, got true: the DDS of {middleware} was built without "
            "security, as in the wheels; source a full ROS 2"
        )
    return error

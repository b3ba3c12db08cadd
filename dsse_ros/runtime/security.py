# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""DDS security that is asked for is had, or the program does not start.

By itself ROS 2 starts unprotected where the environment is misspelt, where the keys are missing and
the strategy is not Enforce, or where a middleware does not know these variables
(design.ros2.org, "ROS 2 Robotic Systems Threat Model" and "ROS 2 DDS-Security integration").
"""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping

from dsse_ros.search import FieldError

ENABLE, STRATEGY, KEYSTORE = (f"ROS_SECURITY_{name}" for name in ("ENABLE", "STRATEGY", "KEYSTORE"))

_ENFORCE = "Enforce"
_ALLOWED = {ENABLE: ("true", "false", ""), STRATEGY: (_ENFORCE, "Permissive", "")}
"""What rcl knows, to the letter; it takes anything else for no."""
_HEEDING = (
    "rmw_fastrtps_cpp",
    "rmw_fastrtps_dynamic_cpp",
    "rmw_cyclonedds_cpp",
    "rmw_connextdds",
)
"""Middlewares that refuse to start unprotected where the strategy is Enforce."""
_WITHOUT = ("have the security libraries", "have security support")
"""What Fast DDS and Cyclone DDS report where they were built without security."""


def is_asked_for(environment: Mapping[str, str]) -> bool:
    """Return whether an environment asks for DDS security.

    Raises:
        FieldError: If it has a value that ROS 2 would take for no.
    """
    for name, allowed in _ALLOWED.items():
        if (value := environment.get(name, "")) not in allowed:
            raise FieldError(f"{name}: {value!r} is not allowed; {' or '.join(allowed[:2])}")
    return environment.get(ENABLE) == "true"


def enforce(environment: MutableMapping[str, str]) -> bool:
    """Have ROS 2 refuse to start unprotected if the environment asks for security.

    Before rclpy starts; the environment is the process's own. Returns whether it does.

    Raises:
        FieldError: If it names no keys, or has a value that ROS 2 would take for no.
    """
    if not is_asked_for(environment):
        return False
    if not environment.get(KEYSTORE):
        raise FieldError(f"{KEYSTORE}: missing with {ENABLE}=true; the folder of the keys")
    environment[STRATEGY] = _ENFORCE
    return True


def check_middleware(environment: Mapping[str, str], middleware: str) -> None:
    """Refuse a middleware that would start unprotected all the same.

    Args:
        environment: The process's own.
        middleware: Name of the ROS middleware.

    Raises:
        FieldError: If the environment asks for security and this one does not heed it.
    """
    if is_asked_for(environment) and middleware not in _HEEDING:
        raise FieldError(
            f"RMW_IMPLEMENTATION: {middleware!r} is not allowed with {ENABLE}=true, which it does "
            f"not heed; one of {', '.join(_HEEDING)}"
        )


def explained(error: str, middleware: str) -> str:
    """Return an error of ROS 2, in other words where the DDS has no security."""
    if any(text in error for text in _WITHOUT):
        return (
            f"{ENABLE}: 'true' is not allowed; the DDS below {middleware} was built without "
            "security, as that of the wheels is: source a full ROS 2"
        )
    return error

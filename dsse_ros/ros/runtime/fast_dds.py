# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The settings of Fast DDS that suit a mission, unless the user has configured it.

Fast DDS announces a process five times at its start, and then every 3 s. A late joiner that misses
the first answer would have no map for that long. As ROS 2 sets it, each place of a queue keeps the
memory of the largest message that was ever in it.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PROFILES = Path(__file__).with_name("fast_dds.xml")
"""Profiles that announce a process every half second, and free the memory of messages."""
MEMORY_FROM_PROFILES = "RMW_FASTRTPS_USE_QOS_FROM_XML"
"""Variable that has ROS 2 leave the memory of messages to the profiles."""

_JAZZY, _LATER = _VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_FILES = ("DEFAULT_FASTRTPS_PROFILES.xml", "DEFAULT_FASTDDS_PROFILES.xml")


def configure(environment: MutableMapping[str, str], folder: Path) -> None:
    """Have Fast DDS use `PROFILES`, unless the user has configured Fast DDS.

    Call it before rclpy starts. Other middlewares ignore the variables.

    Args:
        environment: Environment of the process.
        folder: Working directory of the process, where Fast DDS looks for its default files.
    """
    by_user = any(environment.get(name) for name in _VARIABLES)
    if not by_user and not any((folder / name).is_file() for name in _FILES):
        environment[variable()] = str(PROFILES)
        environment.setdefault(MEMORY_FROM_PROFILES, "1")


def variable() -> str:
    """Return the variable that names the profiles of Fast DDS.

    Jazzy does not know the newer variable, and Kilted warns of the older one.
    """
    try:
        return _JAZZY if int(version("rclpy").split(".")[0]) < 8 else _LATER
    except PackageNotFoundError:
        return _LATER

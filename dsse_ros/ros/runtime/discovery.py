# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Frequent discovery announcements, so that late joiners find the nodes of a mission quickly.

Fast DDS announces a process five times at its start, and then every 3 s. A late joiner that misses
the first answer would have no map for that long.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PROFILES = Path(__file__).with_name("fastdds.xml")
"""Profile of Fast DDS that announces a process every half second."""

_JAZZY, _LATER = _VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_FILES = ("DEFAULT_FASTRTPS_PROFILES.xml", "DEFAULT_FASTDDS_PROFILES.xml")


def announce_often(environment: MutableMapping[str, str], folder: Path) -> None:
    """Make Fast DDS announce this process often, unless the user has configured Fast DDS.

    Call it before rclpy starts. Other middlewares ignore the variables.

    Args:
        environment: Environment of the process.
        folder: Working directory of the process, where Fast DDS looks for its default files.
    """
    by_user = any(environment.get(name) for name in _VARIABLES)
    if not by_user and not any((folder / name).is_file() for name in _FILES):
        environment[variable()] = str(PROFILES)


def variable() -> str:
    """Return the variable that names the profiles of Fast DDS.

    Jazzy does not know the newer variable, and Kilted warns of the older one.
    """
    try:
        return _JAZZY if int(version("rclpy").split(".")[0]) < 8 else _LATER
    except PackageNotFoundError:
        return _LATER

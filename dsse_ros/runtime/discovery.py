# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How soon those who join a mission late find its nodes.

Fast DDS announces a process five times as it starts, and then every 3 s: a newcomer that misses the
first answer has no map for as long.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PROFILES = Path(__file__).with_name("fastdds.xml")
"""Profile of Fast DDS with which a process is announced every half second."""

_JAZZY, _LATER = _VARIABLES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_FILES = ("DEFAULT_FASTRTPS_PROFILES.xml", "DEFAULT_FASTDDS_PROFILES.xml")


def announce_often(environment: MutableMapping[str, str], folder: Path) -> None:
    """Have Fast DDS announce this process often, unless it is configured by the user.

    Before rclpy starts. Other middlewares do not heed the variables.

    Args:
        environment: The process's own.
        folder: In which it was started; Fast DDS looks there for its default files.
    """
    by_user = any(environment.get(name) for name in _VARIABLES)
    if not by_user and not any((folder / name).is_file() for name in _FILES):
        environment[variable()] = str(PROFILES)


def variable() -> str:
    """Return the variable that names the profiles of Fast DDS.

    Of the later one Jazzy knows nothing, and of the older one Kilted warns.
    """
    try:
        return _JAZZY if int(version("rclpy").split(".")[0]) < 8 else _LATER
    except PackageNotFoundError:
        return _LATER

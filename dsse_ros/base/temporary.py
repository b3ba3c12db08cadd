# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A folder for caches and logs of a user whose home cannot be written."""

from __future__ import annotations

import functools
import logging
import os
import stat
import tempfile
from collections.abc import MutableMapping
from pathlib import Path

_LOGGER = logging.getLogger(__name__)
_FOLDERS = {"MPLCONFIGDIR": "matplotlib", "ROS_LOG_DIR": "log"}
"""Variables of libraries that otherwise use the home."""


@functools.cache
def temporary_folder() -> Path:
    """Return a folder below the system's temporary one that nobody else can write to.

    Numba unpickles the files of its cache, and anybody who writes there runs code as this user.

    Raises:
        OSError: If there is no temporary folder.
    """
    user = os.getuid()
    folder = Path(tempfile.gettempdir(), f"dsse_ros-{user}")
    try:
        folder.mkdir(mode=0o700)
    except FileExistsError:
        found = folder.lstat()
        private = stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o077
        if private and found.st_uid == user:
            return folder
        folder = Path(tempfile.mkdtemp(prefix=f"{folder.name}-"))
    _LOGGER.warning(
        "the home of user %s cannot be written: caches and logs are in %s; NUMBA_CACHE_DIR and "
        "ROS_LOG_DIR choose other folders", user, folder,
    )  # fmt: skip
    return folder


def use_without_home(environ: MutableMapping[str, str]) -> None:
    """Have libraries use `temporary_folder` if the home cannot be written.

    Args:
        environ: The environment, whose own choices stay.
    """
    home = environ.get("HOME") or os.path.expanduser("~")
    if os.path.isabs(home):
        # ROS asks for the variable only.
        environ["HOME"] = home
    if os.access(home, os.W_OK | os.X_OK):
        return
    for name, folder in _FOLDERS.items():
        if name not in environ:
            environ[name] = str(temporary_folder() / folder)

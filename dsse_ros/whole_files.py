# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files that a crash leaves with their old or their new content, never with a part of it."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

PART = ".part"
"""End of the name under which a file is written."""


def write_whole(path: Path, content: bytes | Callable[[BinaryIO], object]) -> None:
    """Replace the content of a file, or make it, even if the power fails.

    A file keeps its mode; a new one has that of the umask.

    Args:
        path: Path of the file.
        content: Its content, or a function that writes it to an open file.

    Raises:
        OSError: If the file cannot be written; it stays as it was.
    """
    part = path.with_name(f".{path.name}.{secrets.token_hex(8)}{PART}")
    try:
        with open(part, "xb") as file:
            if isinstance(content, bytes):
                file.write(content)
            else:
                content(file)
            with contextlib.suppress(FileNotFoundError):
                os.fchmod(file.fileno(), path.stat().st_mode & 0o7777)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except BaseException:
        with contextlib.suppress(OSError):
            part.unlink()
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)

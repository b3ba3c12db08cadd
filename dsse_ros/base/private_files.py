# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files with secrets, such as keys, that nobody but their owner may use."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO

_LARGEST = 1 << 16
"""Bytes; a key has 32, a token is one line."""
_OTHERS = stat.S_IRWXG | stat.S_IRWXO


def open_private(path: str | Path) -> BinaryIO:
    """Open a file for writing that only its owner may use, without what it had.

    Raises:
        OSError: If it cannot be written.
    """
    # Somebody may have an older file open: what is written now goes to another one.
    Path(path).unlink(missing_ok=True)
    return os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb")


def read_private(path: str | Path) -> bytes:
    """Return the content of a file that only its owner may use.

    Raises:
        ValueError: If it cannot be read, is too large, or if others than its owner may use
            it; one line.
    """
    try:
        with open(path, "rb") as file:
            # The mode of the open file: the path may lead to another one by now.
            mode = os.fstat(file.fileno()).st_mode
            data = file.read(_LARGEST + 1)
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from error
    if mode & _OTHERS:
        raise ValueError(f"{path}: mode must be 600 to keep it secret, got {mode & 0o777:o}")
    if len(data) > _LARGEST:
        raise ValueError(f"{path}: size must be at most {_LARGEST} bytes")
    return data

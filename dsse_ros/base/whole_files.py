# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files that a crash leaves with their old or their new content, never with a part of it."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

PART = ".part"
"""In the name under which a file is written, before its suffix."""


def write_whole(path: Path, content: bytes | Callable[[BinaryIO], object]) -> None:
    """Replace the content of a file, or make it, even if the power fails.

    A file keeps its mode; a new one has that of the umask.

    Args:
        path: Path of the file.
        content: Its content, or a function that writes it to an open file.

    Raises:
        OSError: If the file cannot be written; it stays as it was.
    """
    with whole_file(path) as part, open(part, "wb") as file:
        if isinstance(content, bytes):
            file.write(content)
        else:
            content(file)


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield the path of a file to write; at the end of the block it replaces the given one.

    It has the same suffix. If the block raises, the given file stays as it was. What is no regular
    file, such as a pipe, is written itself.

    Raises:
        OSError: If the file cannot be written.
    """
    if path.exists() and not path.is_file():
        yield path
        return
    # A link keeps leading to the file.
    stated, path = path, path.resolve()
    part = path.with_name(f".{path.stem}.{secrets.token_hex(8)}{PART}{path.suffix}")
    try:
        with open(part, "xb"):
            pass
        yield part
        with open(part, "rb+") as file:
            with contextlib.suppress(FileNotFoundError):
                os.fchmod(file.fileno(), path.stat().st_mode & 0o7777)
            os.fsync(file.fileno())
        os.replace(part, path)
    except BaseException as error:
        if isinstance(error, OSError) and str(error.filename) == str(part):
            error.filename = str(stated)
        with contextlib.suppress(OSError):
            part.unlink()
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)

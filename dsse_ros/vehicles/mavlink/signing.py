# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The key and the clock of signed messages: https://mavlink.io/en/guide/message_signing.html."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

from dsse_ros.base.private_files import read_private
from dsse_ros.base.whole_files import write_whole

KEY_BYTES = 32
TICKS_PER_S = 100_000
"""Signatures count in units of 10 microseconds."""

_EPOCH_S = 1420070400
"""2015-01-01, where signatures begin to count."""
_RESERVE_S = 10.0


def read_key(path: str | Path) -> bytes:
    """Return the key in a file of 32 bytes or 64 hexadecimal digits.

    Raises:
        ValueError: If there is none in it, or if others than its owner may use it.
    """
    data = read_private(path)
    text = data.strip()
    if len(text) == 2 * KEY_BYTES:
        with contextlib.suppress(ValueError):
            return bytes.fromhex(text.decode("ascii"))
    if len(data) != KEY_BYTES:
        raise ValueError(
            f"{path} must have {KEY_BYTES} bytes or 64 hexadecimal digits, got {len(data)} bytes"
        )
    return data


class SigningClock:
    """A clock that never goes back, even after a restart on a machine whose own clock did.

    The stored time is ahead of every returned one, so that none is ever used twice.

    Args:
        path: File of the stored time; None to start from the machine's clock each time.

    Attributes:
        trouble: Why the time could not be read or stored; None if it could.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.trouble: str | None = None
        self._path = path
        self._last = self._read()
        self._reserved = 0

    def now(self) -> int:
        """Return the time in ticks: the machine's, or one tick after the last if that is later."""
        ticks = int((time.time() - _EPOCH_S) * TICKS_PER_S)
        self._last = max(self._last + 1, ticks)
        if self._last >= self._reserved:
            self._reserved = self._last + int(_RESERVE_S * TICKS_PER_S)
            self._write(self._reserved)
        return self._last

    def used(self, ticks: int) -> None:
        """Take a timestamp that was sent or received for used."""
        self._last = max(self._last, ticks)

    def close(self) -> None:
        """Store the exact time."""
        self._write(self._last)

    def _read(self) -> int:
        if self._path is None:
            return 0
        try:
            return max(0, int(self._path.read_text()))
        except FileNotFoundError:
            return 0
        except (OSError, ValueError) as error:
            self.trouble = f"{self._path}: {error}"
            return 0

    def _write(self, ticks: int) -> None:
        if self._path is None:
            return
        try:
            write_whole(self._path, f"{ticks}\n".encode())
        except OSError as error:
            self.trouble = f"{self._path}: {error.strerror}"

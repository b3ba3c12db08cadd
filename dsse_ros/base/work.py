# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far a long computation is, told to whoever has asked to be told."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_REPORT_S = 1.0
"""Wall time until the first line of a computation, and between two."""
_told: ContextVar[Callable[[str], object] | None] = ContextVar("told", default=None)


@contextmanager
def work_told_to(tell: Callable[[str], object]) -> Iterator[None]:
    """Have long computations in the block tell how far they are, in this thread.

    Args:
        tell: Called with a line such as `drift 40 %`, once a second at most.
    """
    token = _told.set(tell)
    try:
        yield
    finally:
        _told.reset(token)


class Work:
    """A computation that may take long.

    Args:
        what: Its name.
    """

    def __init__(self, what: str) -> None:
        self._what = what
        self._due_s = time.monotonic() + _REPORT_S

    def done(self, share: float) -> None:
        """Tell that this share of it is done, if it is time for another line."""
        tell = _told.get()
        if tell is not None and time.monotonic() >= self._due_s:
            tell(f"{self._what} {100 * share:.0f} %")
            self._due_s = time.monotonic() + _REPORT_S

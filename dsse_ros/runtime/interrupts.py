# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""SIGINT, SIGTERM, SIGHUP: at once while a program starts, between two callbacks once it runs."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Callable
from types import FrameType

Handler = Callable[[int, FrameType | None], object]

# A program that `nohup` has started is to outlive its terminal.
_OF_TERMINAL = () if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else (signal.SIGHUP,)
_SIGNALS = (signal.SIGINT, signal.SIGTERM, *_OF_TERMINAL)
_GRACE_S = 0.2
"""Wall time that the main thread has to run its handler before the watching thread leaves."""

_leaving = threading.RLock()
_clean_up: list[Callable[[], object]] = []
_watched = False


class Stop:
    """Handler of signals that only notes that one has come.

    Attributes:
        wanted: Whether one has.
    """

    wanted = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Note it."""
        self.wanted = True


def on_signals(handler: Handler | signal.Handlers) -> None:
    """Have SIGINT, SIGTERM and SIGHUP handled by this."""
    for number in _SIGNALS:
        signal.signal(number, handler)


def leave_on_signals(*clean_up: Callable[[], object]) -> None:
    """Have them end the process at once, with the code a shell has for the signal.

    Python runs a handler when the main thread is back from C, and LLVM may optimise one function
    for seconds: a thread watches too. No exception would do either, as numba loses some.

    Args:
        clean_up: Called before; may raise.
    """
    global _watched
    _clean_up[:] = clean_up
    if not _watched:
        _watched = True
        read, write = os.pipe()
        os.set_blocking(write, False)
        signal.set_wakeup_fd(write, warn_on_full_buffer=False)
        threading.Thread(target=_watch, args=(read,), daemon=True).start()
    on_signals(_leave)


def _watch(read: int) -> None:
    while numbers := os.read(read, 1):
        time.sleep(_GRACE_S)
        # Another handler may have taken over meanwhile.
        if signal.getsignal(numbers[0]) is _leave:
            _leave(numbers[0], None)


def _leave(number: int, frame: FrameType | None) -> None:
    if threading.current_thread() is threading.main_thread():
        on_signals(signal.SIG_IGN)
    # Never released: a second caller waits for the end.
    _leaving.acquire()
    for clean_up in _clean_up:
        with contextlib.suppress(Exception):
            clean_up()
    os._exit(128 + number)

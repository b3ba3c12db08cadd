# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""SIGINT, SIGTERM, SIGHUP: at once while a program starts, between two callbacks once it runs."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType

Handler = Callable[[int, FrameType | None], object]

# A program started by `nohup` must outlive its terminal.
_OF_TERMINAL = () if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else (signal.SIGHUP,)
_SIGNALS = (signal.SIGINT, signal.SIGTERM, *_OF_TERMINAL)
_GRACE_S = 0.2
"""Wall time in which the main thread must run its handler before the watching thread exits."""

STUCK_S = 5.0
"""Wall time after a signal in which a node's loop must end."""

_PR_SET_PDEATHSIG = 1

_leaving = threading.RLock()
_clean_up: list[Callable[[], object]] = []
_code: int | None = None
_watched = False


class Stop:
    """Signal handler that only records that a signal has come.

    Attributes:
        wanted: Whether a signal has come.
    """

    wanted = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Record the signal."""
        self.wanted = True


class WatchedStop(Stop):
    """The same for a loop that must end: if it does not, a thread ends the process.

    That is at the second signal, or `STUCK_S` after the first one; `leave_on_signals` starts the
    thread.

    Args:
        hand_over: Called from a thread before the exit; may raise.

    Attributes:
        loop_ended: To be set once the loop has ended.
    """

    def __init__(self, hand_over: Callable[[], object]) -> None:
        self._hand_over = hand_over
        self._signals = 0
        self.loop_ended = threading.Event()

    def watch(self, number: int) -> None:
        """Handle a signal beside the main thread, which may not return from a callback."""
        self._signals += 1
        patience_s = STUCK_S if self._signals == 1 else 0.0
        threading.Thread(
            target=self._leave_if_stuck, args=(number, patience_s), daemon=True
        ).start()

    def _leave_if_stuck(self, number: int, patience_s: float) -> None:
        if self.loop_ended.wait(patience_s):
            return
        # Never released: a second caller waits for the end.
        _leaving.acquire()
        with contextlib.suppress(Exception):
            self._hand_over()
        os._exit(128 + number)


def on_signals(handler: Handler | signal.Handlers) -> None:
    """Set the handler of SIGINT, SIGTERM and SIGHUP."""
    for number in _SIGNALS:
        signal.signal(number, handler)


def leave_on_signals(*clean_up: Callable[[], object], code: int | None = None) -> None:
    """Make these signals end the process at once.

    Python runs a handler only after the main thread has returned from C, and LLVM may optimise one
    function for seconds, so a thread watches too. Raising would not work: Numba can swallow
    exceptions.

    Args:
        clean_up: Called before the exit; may raise.
        code: Exit code; None for the shell's code of the signal.
    """
    global _code, _watched
    _clean_up[:] = clean_up
    _code = code
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
        # Another handler may be set by now.
        handler = signal.getsignal(numbers[0])
        if handler is _leave:
            _leave(numbers[0], None)
        elif isinstance(handler, WatchedStop):
            handler.watch(numbers[0])


def _leave(number: int, frame: FrameType | None) -> None:
    if threading.current_thread() is threading.main_thread():
        on_signals(signal.SIG_IGN)
    # Never released: a second caller waits for the end.
    _leaving.acquire()
    for clean_up in _clean_up:
        with contextlib.suppress(Exception):
            clean_up()
    os._exit(128 + number if _code is None else _code)


def end_with(parent: int) -> None:
    """Have this process interrupted when its parent ends, however that ends.

    Args:
        parent: Process id of the parent, which may have ended already.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    libc.prctl(_PR_SET_PDEATHSIG, signal.SIGINT, 0, 0, 0)
    if os.getppid() != parent:
        sys.exit(0)

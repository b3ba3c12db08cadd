# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Signals end a program that starts at once, wherever its main thread is."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest

# A lock that is taken twice is never had: as long in C as LLVM could ever be. What cleans up must
# not print: a signal may come before the print that announces it has returned.
IN_C = """
import ctypes, os
from dsse_ros.ros.runtime.interrupts import leave_on_signals

leave_on_signals(lambda: os.write(1, b"cleaned up\\n"))
libc, mutex = ctypes.CDLL(None), ctypes.create_string_buffer(64)
libc.pthread_mutex_lock(mutex)
print("in C", flush=True)
libc.pthread_mutex_lock(mutex)
"""
IN_PYTHON = """
import os
from dsse_ros.ros.runtime.interrupts import leave_on_signals

leave_on_signals(lambda: os.write(1, b"cleaned up\\n"))
print("in Python", flush=True)
while True:
    pass
"""
HANDED_OVER = """
import signal, time
from dsse_ros.ros.runtime.interrupts import Stop, leave_on_signals, on_signals

leave_on_signals()
stop = Stop()
on_signals(stop)
signal.raise_signal(signal.SIGINT)
time.sleep(1)
print("noted" if stop.wanted else "missed")
"""
STUCK = """
import os
from dsse_ros.ros.runtime import interrupts

interrupts.STUCK_S = float(os.environ["STUCK_S"])
interrupts.leave_on_signals()
stop = interrupts.WatchedStop(lambda: os.write(1, b"handed over\\n"))
interrupts.on_signals(stop)
print("stuck", flush=True)
while not (stop.wanted and os.environ["ENDS"]):
    pass
stop.loop_ended.set()
interrupts.on_signals(interrupts.signal.SIG_IGN)
interrupts.time.sleep(2)
print("ended", flush=True)
"""


# Where nohup has started the tests, it has the programs that they start ignore it too.
OF_TERMINAL = [] if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else [signal.SIGHUP]


@pytest.mark.slow
@pytest.mark.parametrize("code", [IN_C, IN_PYTHON], ids=["in C", "in Python"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, *OF_TERMINAL])
@pytest.mark.parametrize("times", [1, 3])
def test_a_signal_ends_a_program_wherever_it_is(
    code: str, number: signal.Signals, times: int
) -> None:
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        assert child.stdout and child.stdout.readline().startswith("in ")
        for _ in range(times):
            child.send_signal(number)
        output, _ = child.communicate(timeout=120)
    finally:
        child.kill()
    assert child.returncode == 128 + number
    assert output == "cleaned up\n"


@pytest.mark.slow
def test_a_program_that_nohup_has_started_outlives_its_terminal() -> None:
    ignored = "import signal\nsignal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
    hung_up = HANDED_OVER.replace("SIGINT", "SIGHUP")
    done = subprocess.run(
        [sys.executable, "-c", ignored + hung_up], capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "missed\n", "")


@pytest.mark.slow
def test_another_handler_can_take_the_signals_over() -> None:
    done = subprocess.run(
        [sys.executable, "-c", HANDED_OVER], capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "noted\n", "")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stuck_s", "ends", "times", "output", "code"),
    [
        ("0.5", "", 1, "handed over\n", 128 + signal.SIGTERM),
        ("600", "", 2, "handed over\n", 128 + signal.SIGTERM),
        ("0.5", "yes", 1, "ended\n", 0),
        ("600", "yes", 1, "ended\n", 0),
    ],
    ids=["one that waits", "two", "a loop that ends", "a loop that ends, patiently"],
)
def test_a_loop_that_does_not_end_is_ended_once_it_is_handed_over(
    monkeypatch: pytest.MonkeyPatch, stuck_s: str, ends: str, times: int, output: str, code: int
) -> None:
    monkeypatch.setenv("STUCK_S", stuck_s)
    monkeypatch.setenv("ENDS", ends)
    child = subprocess.Popen([sys.executable, "-c", STUCK], stdout=subprocess.PIPE, text=True)
    try:
        assert child.stdout and child.stdout.readline() == "stuck\n"
        for _ in range(times):
            child.send_signal(signal.SIGTERM)
            # Two signals that come at once are one.
            time.sleep(1.0)
        left, _ = child.communicate(timeout=120)
    finally:
        child.kill()
    assert (left, child.returncode) == (output, code)

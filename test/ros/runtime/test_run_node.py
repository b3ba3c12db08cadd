# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A node's process ends, whatever ROS does."""

from __future__ import annotations

import subprocess
import sys

import pytest

# A lock that is taken twice is never had. PyDLL keeps Python's lock, as rclpy does.
DEADLOCK = """
import ctypes
from dsse_ros.ros.runtime import run_node

run_node.LEAVING_S = 1.0

class Stuck(run_node.AlarmNode):
    finished = True

    def destroy_node(self):
        libc, mutex = ctypes.PyDLL(None), ctypes.create_string_buffer(64)
        for _ in range(2):
            libc.pthread_mutex_lock(mutex)

run_node.run_node("stuck", lambda: Stuck("stuck"), [])
"""

LEAVES = """
import faulthandler
from pathlib import Path
from dsse_ros.ros.runtime import run_node

class Finished(run_node.AlarmNode):
    def __init__(self):
        super().__init__("finished")
        self.end = self.alarms.make(lambda: setattr(self, "finished", True))
        self.end.set(0.5)

def threads():
    names = [path.read_text() for path in Path("/proc/self/task").glob("*/comm")]
    # The events of a participant; a thread for shared memory stays.
    return sum(name.startswith("dds.ev") for name in names)

def make():
    node = Finished()
    print(threads() > 0)
    return node

cancel = faulthandler.cancel_dump_traceback_later
faulthandler.cancel_dump_traceback_later = lambda: (print(threads()), cancel())
run_node.run_node("finished", make, [])
"""

REFUSED_IN_TURN = """
import contextlib, io, time
from dsse_ros.ros.runtime import run_node
from dsse_ros.base.fields import FieldError

run_node.LEAVING_S = 1.0

def refuse():
    raise FieldError("refused")

errors = io.StringIO()
with contextlib.redirect_stderr(errors):
    codes = [run_node.run_node("node", refuse, []) for _ in range(2)]
time.sleep(1.5)
print(codes, errors.getvalue().count("refused"))
"""


@pytest.mark.slow
def test_a_node_that_cannot_leave_ros_ends_and_says_where_it_hung() -> None:
    done = subprocess.run(
        [sys.executable, "-c", DEADLOCK], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 1
    assert "Timeout (0:00:01)!" in done.stderr
    assert "in destroy_node" in done.stderr


@pytest.mark.slow
def test_the_time_to_leave_ros_lasts_until_the_participant_is_gone() -> None:
    done = subprocess.run(
        [sys.executable, "-c", LEAVES], capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stdout) == (0, "True\n0\n"), done.stderr


@pytest.mark.slow
def test_a_program_with_its_own_stderr_starts_one_node_after_the_other() -> None:
    done = subprocess.run(
        [sys.executable, "-c", REFUSED_IN_TURN], capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stdout) == (0, "[2, 2] 2\n"), done.stderr

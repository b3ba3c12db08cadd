# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rigs of the tests, for the soak: nodes as processes, and simulated autopilots."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path

from bridge_rig import Bridge, autopilots, fly, health_when
from rig import ENVIRONMENT, Process, Rig, Sim, search_of

from dsse_ros.ros.runtime.fast_dds import MEMORY_FROM_PROFILES, variable

__all__ = [
    "DOWN",
    "ENVIRONMENT",
    "SEARCH",
    "UP",
    "Bridge",
    "Process",
    "Rig",
    "Sim",
    "autopilots",
    "domain",
    "open_files",
    "threads",
    "until",
    "fly",
    "health_when",
    "resident_bytes",
    "search_of",
    "shared_files",
    "use_defaults_of_dds",
]

UP, DOWN, SEARCH = 2, 3, 4
"""Numbers of actions in the rules `paper`."""


@contextlib.contextmanager
def domain(folder: Path) -> Iterator[Rig]:
    """Join a free ROS domain, in which nodes can be started; they are stopped at the end."""
    folder.mkdir(parents=True, exist_ok=True)
    os.environ.update(ENVIRONMENT)
    rig = Rig(folder)
    try:
        yield rig
    finally:
        rig.close()


def use_defaults_of_dds() -> None:
    """Let later nodes discover and resend like the nodes of users, not like those of the tests."""
    for name in (variable(), MEMORY_FROM_PROFILES):
        ENVIRONMENT.pop(name, None)


def resident_bytes(pid: int) -> int:
    """Return the private memory of a process, without shared memory."""
    fields = dict(
        line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines()
    )
    return int(fields["RssAnon"].split()[0]) * 1024


def open_files(pid: int) -> int:
    """Return the number of descriptors of a process."""
    return len(list(Path(f"/proc/{pid}/fd").iterdir()))


def threads(pid: int) -> int:
    """Return the number of threads of a process."""
    return len(list(Path(f"/proc/{pid}/task").iterdir()))


def shared_files(pid: int | str) -> set[str]:
    """Return the files of Fast DDS in shared memory that a process has, except ports.

    Ports are for later processes.
    """
    try:
        maps = Path(f"/proc/{pid}/maps").read_text()
    except OSError:  # It has ended, or belongs to another user.
        return set()
    return {
        part for part in maps.split() if part.startswith("/dev/shm/fast") and "port" not in part
    }


def until(condition: object, what: str, timeout_s: float = 120.0) -> None:
    """Wait until a function returns a true value, without ROS.

    Raises:
        AssertionError: If it does not do so in time.
    """
    assert callable(condition)
    end_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end_s, f"{what} within {timeout_s:g} s"
        time.sleep(0.02)

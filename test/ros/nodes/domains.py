# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""ROS domains for tests that run at the same time."""

from __future__ import annotations

import fcntl
import os
import random
import socket
import tempfile
from collections import deque
from pathlib import Path
from typing import IO

_locks: deque[IO[bytes]] = deque()
_MOST_LOCKS = 8
"""Those that came before the last of these have ended, or hold a port of their domain."""
_PROBED = 10
"""Participants whose ports are tried: the first one of a domain may have ended before others."""


def free_domain() -> int:
    """Return a ROS domain that no process of this machine is in, and keep it from other tests."""
    # Domains above 101 take ports that the system gives to anybody.
    for domain in random.sample(range(1, 102), 101):
        path = Path(tempfile.gettempdir()) / f"dsse_ros_test_domain_{os.getuid()}_{domain}"
        lock = path.open("wb")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            for participant in range(_PROBED):
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                    # DDSI-RTPS 2.3, 9.6.1.1
                    probe.bind(("127.0.0.1", 7400 + 250 * domain + 10 + 2 * participant))
        except OSError:
            lock.close()
            continue
        _locks.append(lock)
        if len(_locks) > _MOST_LOCKS:
            _locks.popleft().close()
        return domain
    raise RuntimeError("no ROS domain is free")

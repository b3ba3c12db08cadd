# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who waits for the compiler sees how far it is, on a terminal."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from pathlib import Path

from dsse_ros.search.compiler import COMPILING

# Two functions are the least that can be compiled on their own.
SCRIPT = """
import numpy as np
from dsse_ros.belief import belief_kernels
from dsse_ros.search.compiler import announced
with announced(print, belief=True):
    belief_kernels.normalise(np.ones((2, 4)))
"""


def test_on_a_terminal_a_bar_counts_the_functions_that_are_compiled(tmp_path: Path) -> None:
    terminal, stderr = pty.openpty()
    fcntl.ioctl(stderr, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 90, 0, 0))
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, stderr=stderr, text=True,
        check=True, env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
    )  # fmt: skip
    os.close(stderr)
    shown = os.read(terminal, 10**5).decode()
    os.close(terminal)
    assert done.stdout.strip() == COMPILING
    counts = [(int(n), int(total)) for n, total in re.findall(r"compiling:.*?(\d+)/(\d+)", shown)]
    assert counts[0][0] == 0 and counts[-1][0] in (1, 2)
    assert all(total > 50 for _, total in counts)

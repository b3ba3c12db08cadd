# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How every program of the package ends, without ROS."""

from __future__ import annotations

import sys

MISSING = 1
"""Exit code where something that the program needs is not installed."""
BAD_INPUT = 2
"""Exit code after an input that is not allowed."""
FAILED = 3
"""Exit code where a file could not be written to its end, or a check has failed."""


def fail(name: str, error: object) -> int:
    """Print what is wrong on one line and return the exit code for it."""
    # What was printed before comes before it, also where both go to one file.
    sys.stdout.flush()
    print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
    return BAD_INPUT

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How every program of the package ends, without ROS."""

from __future__ import annotations

import sys

MISSING = 1
"""Exit code if a dependency of the program is not installed."""
BAD_INPUT = 2
"""Exit code for bad input."""
FAILED = 3
"""Exit code if a file could not be written completely, or a check has failed."""


def fail(name: str, error: object) -> int:
    """Print what is wrong on one line and return the exit code for it."""
    # Keep the order of stdout and stderr if both go to one file.
    sys.stdout.flush()
    print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
    return BAD_INPUT

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Puts the helpers where the tests can import them."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
TESTS = HERE.parent
sys.path[:0] = [str(HERE), *(str(TESTS / name) for name in ("search", "dashboard", "nodes"))]

from browsers import browser  # noqa: E402, F401

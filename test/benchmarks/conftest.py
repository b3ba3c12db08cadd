# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Puts the benchmarks and the helpers of the search's tests where these tests can import them."""

import sys
from pathlib import Path

# After whatever is installed.
sys.path.append(str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "search"))

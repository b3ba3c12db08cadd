# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Puts the helpers of the nodes' and of mission items where these can import them."""

import os
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS / "nodes"), str(TESTS / "mission_items")]

from rig import ENVIRONMENT  # noqa: E402

os.environ.update(ENVIRONMENT)

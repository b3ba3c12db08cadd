# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A ROS domain per module."""

from __future__ import annotations

import os
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "search")]

from rig import ENVIRONMENT, rig_of_module  # noqa: E402, F401

os.environ.update(ENVIRONMENT)

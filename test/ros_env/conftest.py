# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A domain with nodes in it, as the tests of the nodes have it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "nodes"))

from rig import ENVIRONMENT, rig_of_module  # noqa: E402, F401

os.environ.update(ENVIRONMENT)

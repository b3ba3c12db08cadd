# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Puts the helpers of the nodes' tests where these can import them."""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "nodes"))

from rig import ENVIRONMENT  # noqa: E402

os.environ.update(ENVIRONMENT)

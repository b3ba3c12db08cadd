# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Puts the helpers of these tests where they can import them."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Speed and memory against the published packages and a C baseline; published figures."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

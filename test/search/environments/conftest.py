# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keeps windows closed."""

import os

os.environ["MPLBACKEND"] = "agg"

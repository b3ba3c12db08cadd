# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Building blocks of compiled functions: compiler options, draws, streaming writes, routes."""

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions in MCAP files: written, read back and flown again by their reports; no node."""

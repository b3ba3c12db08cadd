# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Worlds, snapshots and the PettingZoo environments of a search."""

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions of vehicles: their items, from tracks and to files, apart from each other in the air."""

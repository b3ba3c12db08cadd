# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Campaigns: planners on scenarios, thousands of missions of each, compared in pairs."""

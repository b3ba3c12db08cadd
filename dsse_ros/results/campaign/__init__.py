# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Campaigns: thousands of missions of planners in scenarios, compared in pairs."""

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drift of objects at sea: leeway, wind and current, the shore, and tracks of many particles."""

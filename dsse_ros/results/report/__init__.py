# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The report of a recorded mission: its numbers, figures and page."""

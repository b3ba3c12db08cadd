# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scenarios and rules of a search: their checked fields and their files."""

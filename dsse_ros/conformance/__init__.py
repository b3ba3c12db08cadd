# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tests of what others make: does it keep the promises of its contract?"""

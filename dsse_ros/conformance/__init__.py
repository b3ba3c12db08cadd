# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tests of the contracts that anybody can run on a part of their own."""

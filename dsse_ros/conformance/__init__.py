# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Conformance tests for your own sensors, kinds of drones, beliefs and target models.

Each test raises `AssertionError` with one line that names the broken promise.
"""

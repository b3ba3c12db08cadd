# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a sensor, a kind of drone or a model of targets must keep, as tests that anybody can run.

Each of them raises `AssertionError` with one line that says which promise is broken.
"""

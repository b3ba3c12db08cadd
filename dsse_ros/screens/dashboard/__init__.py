# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The live page of missions, without ROS: its state, its contents, and access to it."""

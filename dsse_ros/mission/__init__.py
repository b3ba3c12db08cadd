# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Successive missions without ROS: commands, timing of the steps, the log."""

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Planners: policies from observations to actions, the same for ROS and the PettingZoo env."""

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drone swarm search and rescue at sea: a PettingZoo world, planners and ROS 2 nodes."""

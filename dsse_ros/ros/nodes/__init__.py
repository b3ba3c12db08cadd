# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 nodes: timers, topics and parameters around the search and its adapters."""

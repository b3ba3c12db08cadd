# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Pure functions between the world and ROS 2 messages: no node, clock, socket or logger."""

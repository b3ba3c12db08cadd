# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""ROS 2: the nodes and what they share."""

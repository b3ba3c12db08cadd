# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""MAVLink without ROS: links, mission transfer, vehicles, and how they follow a search."""

# SPDX-License-Identifier: Apache-2.0
"""MAVLink without ROS: links, mission transfer, vehicles, and how they follow a search."""

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search that vehicles fly: simulation, planner and bridge; the vehicles run elsewhere."""

from launch import LaunchDescription

from dsse_ros.nodes.launch_arguments import FLIGHT
from dsse_ros.nodes.launching import describe


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments, then start the nodes."""
    return describe(FLIGHT)

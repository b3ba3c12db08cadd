# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission: the simulation, a planner and, with `rviz:=true`, RViz."""

from launch import LaunchDescription

from dsse_ros.nodes.launch_arguments import MISSION
from dsse_ros.nodes.launching import describe


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments, then start the nodes."""
    return describe(MISSION)

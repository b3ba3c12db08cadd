# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission: the simulation, a planner and, with `rviz:=true`, RViz."""

from launch import LaunchContext, LaunchDescription
from launch_ros.actions import Node

from dsse_ros.ros.nodes.launching import description, mission_arguments, mission_nodes


def nodes(context: LaunchContext) -> list[Node]:
    """Return the nodes to start."""
    return mission_nodes(context, "mission.yml", more={}, fixed={})


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments, then start the nodes."""
    return description(__file__, mission_arguments(), nodes)

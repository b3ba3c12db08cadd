# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search that vehicles fly: simulation, planner and bridge; the vehicles run elsewhere."""

from launch import LaunchContext, LaunchDescription
from launch_ros.actions import Node

from dsse_ros.ros.nodes.launching import (
    argument,
    description,
    leave_to_bridge,
    mission_arguments,
    mission_nodes,
    node,
)
from dsse_ros.vehicles.autopilots import AUTOPILOTS

ARGUMENTS = [
    argument("mode", "What the vehicles fly: guided or mission."),
    argument("connections", "MAVLink connections of the vehicles, drone0's first: [one, two]."),
    argument("autopilot", f"Autopilot of the vehicles: {', '.join(AUTOPILOTS)}."),
    argument("arm", "Searches for which vehicles may be armed: false, true or always."),
]


def nodes(context: LaunchContext) -> list[Node]:
    """Return the nodes to start."""
    mode = context.launch_configurations["mode"]
    # In a mission the vehicles start when the search is over.
    waits = {"vehicle_time": "followed" if mode == "guided" else "ignored"} if mode else {}
    of_bridge = {name: name for name in ("mode", "connections", "autopilot", "arm")}
    of_bridge["num_vehicles"] = "num_drones"
    return [
        # Without a planner, or a simulation, an operator needs the bridge all the more.
        *mission_nodes(
            context, "flight.yml", {"autopilot": "autopilot"}, waits, on_exit=leave_to_bridge
        ),
        node(context, "mavlink_bridge", ["mavlink_bridge.yml", "flight.yml"], of_bridge),
    ]


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments, then start the nodes."""
    return description(__file__, [*mission_arguments(), *ARGUMENTS], nodes)

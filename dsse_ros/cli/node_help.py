# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`--help` of the nodes, whose arguments are those of ROS; this module imports no ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from dsse_ros.base.extras import page

_NODES: Mapping[str, tuple[str, str, str]] = MappingProxyType(
    {
        "sim_node": (
            "Runs the search and takes commands from topics.",
            "-p scenario:=santos -p step_rate:=5.0 -p auto_reset:=true",
            "ros.md",
        ),
        "planner_node": (
            "Commands the drones, from the topics alone.",
            "-p planner:=belief",
            "planners.md",
        ),
        "mavlink_bridge": (
            "Makes vehicles fly what the drones of the simulation do.",
            "-p autopilot:=px4 -p num_vehicles:=3",
            "flight.md",
        ),
        "show": ("Prints the step reports as a table, live.", "-p width:=120", "ros.md"),
        "recorder": ("Records missions to an MCAP file.", "-p bag:=mission.mcap", "recording.md"),
        "foxglove_viewer": (
            "Serves all topics to Foxglove, over its WebSocket protocol.",
            "-p port:=8765",
            "viewers.md",
        ),
        "cot_gateway": (
            "Sends the search as Cursor on Target, for ATAK.",
            "-p url:=udp://127.0.0.1:4242",
            "viewers.md",
        ),
        "dashboard": ("Shows the search live in a browser.", "-p port:=8080", "dashboard.md"),
    }
)
"""Of each node: what it does, an example of its arguments, and its page in docs/."""


def is_wanted(arguments: Sequence[str]) -> bool:
    """Return whether the arguments of a node ask for help."""
    return not {"-h", "--help"}.isdisjoint(arguments)


def node_help(name: str, command: str) -> str:
    """Return the help of a node."""
    does, example, about = _NODES[name]
    call = f"ros2 run dsse_ros {name}" if f"lib/dsse_ros/{name}" in command else command
    return (
        f"usage: {call} [--ros-args [-p NAME:=VALUE] [--params-file FILE] [-r FROM:=TO] ...]\n\n"
        f"{does}\n\n"
        f"example:\n  {call} --ros-args {example}\n\n"
        f"parameters: {page('parameters.md')}\nmore: {page(about)}"
    )

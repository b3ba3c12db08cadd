# SPDX-License-Identifier: Apache-2.0
"""A search that vehicles fly: simulation, planner and bridge; the vehicles run elsewhere."""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

SHARE = FindPackageShare("dsse_ros")
ARGUMENTS = {
    "scenario": (PathJoinSubstitution([SHARE, "config", "sitl.yaml"]), "YAML file"),
    "bridge": (
        PathJoinSubstitution([SHARE, "config", "mavlink_bridge.yml"]),
        "parameters of the bridge",
    ),
    "planner": ("greedy", "name of the planner"),
    "seed": ("", "of sea, persons and planner; empty: the nodes' own"),
    "arm": ("false", "whether vehicles may be armed"),
    "namespace": ("", "namespace of all nodes"),
}


def nodes(context: LaunchContext) -> list[Node]:
    """Nodes for the given arguments; what is left empty is no parameter at all."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    seed = [{"seed": int(given["seed"])}] if given["seed"] else []
    namespace = given["namespace"]
    return [
        Node(
            package="dsse_ros",
            executable="sim_node",
            namespace=namespace,
            parameters=[{"scenario": given["scenario"], "wait_for_vehicles": True}, *seed],
            output="screen",
            on_exit=Shutdown(reason="the simulation has ended"),
        ),
        Node(
            package="dsse_ros",
            executable="mavlink_bridge",
            namespace=namespace,
            parameters=[given["bridge"], {"arm": given["arm"].lower() == "true"}],
            output="screen",
            on_exit=Shutdown(reason="the bridge has ended"),
        ),
        Node(
            package="dsse_ros",
            executable="planner_node",
            namespace=namespace,
            parameters=[{"planner": given["planner"]}, *seed],
            output="screen",
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments, then start the nodes."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])

# SPDX-License-Identifier: Apache-2.0
"""A mission: the simulation, a planner and, with `rviz:=true`, RViz."""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

SHARE = FindPackageShare("dsse_ros")
ARGUMENTS = {
    "scenario": (PathJoinSubstitution([SHARE, "config", "santos.yaml"]), "YAML file"),
    "planner": ("greedy", "name of the planner"),
    "num_drones": ("", "empty: the scenario's"),
    "seed": ("", "of sea, persons and planner; empty: the nodes' own"),
    "namespace": ("", "namespace of all nodes"),
    "step_rate": ("5", "steps per second at most; 0: no limit"),
    "rviz": ("false", "show the mission in RViz"),
}


def nodes(context: LaunchContext) -> list[Node]:
    """Nodes for the given arguments; what is left empty is no parameter at all."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    namespace = given["namespace"]
    sim = {name: given[name] for name in ("scenario", "num_drones", "seed") if given[name]}
    planner = {name: given[name] for name in ("planner", "seed") if given[name]}
    return [
        Node(
            package="dsse_ros",
            executable="sim_node",
            namespace=namespace,
            parameters=[sim | {"step_rate": float(given["step_rate"])}],
            output="screen",
            on_exit=Shutdown(reason="the simulation has ended"),
        ),
        Node(
            package="dsse_ros",
            executable="planner_node",
            namespace=namespace,
            parameters=[planner],
            output="screen",
        ),
        Node(
            package="rviz2",
            executable="rviz2",
            namespace=namespace,
            parameters=[{"use_sim_time": True}],
            arguments=["-d", PathJoinSubstitution([SHARE, "rviz", "mission.rviz"])],
            condition=IfCondition(given["rviz"]),
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments, then start the nodes."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The common parts of the launch files: the arguments of a mission, and its nodes.

The nodes check the values. Arguments that are not given leave the choice to the parameter files.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_prefix, get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from dsse_ros.base.fields import check_known
from dsse_ros.ros.runtime.exit_codes import BAD_INPUT
from dsse_ros.ros.runtime.ros_arguments import check_reached, reaching

_BOOL = ["true", "false"]
_WATCHERS = ("recorder", "foxglove_viewer", "rviz2")
_NODES = ("sim_node", "planner_node", "mavlink_bridge", *_WATCHERS)
"""All nodes that a launch may start."""
OnExit = Callable[[Any, LaunchContext], Shutdown | None]
_FAILURE = "dsse_ros_failure"


def argument(
    name: str, description: str, default: str = "", choices: Sequence[str] = ()
) -> DeclareLaunchArgument:
    """Return an argument of a launch file."""
    return DeclareLaunchArgument(
        name, default_value=default, description=description, choices=list(choices) or None
    )


def description(
    file: str,
    arguments: Sequence[DeclareLaunchArgument],
    nodes: Callable[[LaunchContext], list[Node]],
) -> LaunchDescription:
    """Return what a launch file describes: its arguments, then its nodes.

    Args:
        file: The launch file, started by `ros2 launch` or included by another.
        arguments: Its arguments; others are refused, as launch ignores them.
        nodes: Returns its nodes.
    """

    def checked(context: LaunchContext) -> list[Node]:
        if _is_started(file):
            names = [word.partition(":=")[0] for word in context.argv]
            check_known("the launch arguments", names, [argument.name for argument in arguments])
        return nodes(context)

    return LaunchDescription([*arguments, OpaqueFunction(function=checked)])


def _is_started(file: str) -> bool:
    """Return whether the command line names this file, not one that includes it."""
    words = [word for word in sys.argv if ":=" not in word]
    named = "dsse_ros" in words and Path(file).name in words
    return named or Path(file).resolve() in [Path(word).resolve() for word in words]


def mission_arguments() -> list[DeclareLaunchArgument]:
    """Return the arguments for `mission_nodes`."""
    return [
        argument("params_file", "File of parameters of any of the nodes; arguments override it."),
        argument("scenario", "YAML file, or name of a scenario of the package."),
        argument("rules", "Profile of the rules."),
        argument("planner", "Planner that commands the drones."),
        argument("num_drones", "Number of drones; by default the scenario's."),
        argument("seed", "Seed of the map, the persons and the planner; by default drawn."),
        argument("step_rate", "Steps per second of wall time at most, 0 for no limit."),
        argument("use_sim_time", "Whether planner and viewers use /clock.", "true", _BOOL),
        argument("namespace", "Namespace of all nodes."),
        argument("frame_prefix", "Prefix of all frames, such as one/."),
        argument("record", "Whether to record the mission; a bag does too.", "false", _BOOL),
        argument(
            "bag", "MCAP file of the recording, a new one; by default named by date and time."
        ),
        argument("rviz", "Whether to show the mission in RViz.", "false", _BOOL),
        argument(
            "viewer", "Whether to serve the topics to Foxglove.", "none", ["none", "foxglove"]
        ),
        argument("log_level", "Level of the nodes' own logs, such as debug."),
        argument("enclaves", "Path of the security enclaves of the nodes.", "/dsse_ros"),
    ]


def mission_nodes(
    context: LaunchContext,
    defaults: str,
    more: Mapping[str, str],
    fixed: Mapping[str, Any],
    on_exit: OnExit | None = None,
) -> list[Node]:
    """Return the nodes of a mission, the recorder first, or it would miss what is not latched.

    Args:
        context: Of the launch.
        defaults: File in config/ with the default parameters.
        more: Parameters of `sim_node`, see `node`.
        fixed: Parameters of `sim_node` by their values, see `node`.
        on_exit: What the end of the simulation or the planner does; by default it ends the launch.
    """
    values = context.launch_configurations
    clock = {"use_sim_time": "use_sim_time"}
    of_simulation = {
        "scenario.file": "scenario",
        "rules.profile": "rules",
        "scenario.num_drones": "num_drones",
        **{name: name for name in ("seed", "step_rate", "frame_prefix")},
        **more,
    }
    of_planner = {**clock, "planner": "planner", "seed": "seed"}
    ends: dict[str, Any] = {"on_exit": on_exit} if on_exit else {}
    nodes = [
        node(context, "sim_node", [defaults], of_simulation, fixed, **ends),
        node(context, "planner_node", [defaults], of_planner, **ends),
    ]
    if values["record"] == "true" or values["bag"]:
        nodes.insert(0, node(context, "recorder", [defaults], {"bag": "bag"}))
    if values["viewer"] == "foxglove":
        nodes.append(node(context, "foxglove_viewer", [defaults], clock))
    if values["rviz"] == "true":
        # Fail before any node has started if it is not installed.
        get_package_prefix("rviz2")
        config = str(_share() / "rviz" / "mission.rviz")
        options = ["-d", config, "-f", values["frame_prefix"] + "map"]
        nodes.append(node(context, "rviz2", [], clock, package="rviz2", arguments=options))
    return nodes


def node(
    context: LaunchContext,
    executable: str,
    defaults: Sequence[str],
    names: Mapping[str, str],
    fixed: Mapping[str, Any] | None = None,
    **options: Any,
) -> Node:
    """Return a node with its parameters: of config/, of `params_file`, and of the arguments.

    Args:
        context: Of the launch.
        executable: Name of the executable and of the node.
        defaults: Files in config/.
        names: Names of arguments by the parameters that they set, unless they are empty.
        fixed: More parameters by name.
        options: Further arguments of `Node`.

    Raises:
        FieldError: As `_files_for`.
    """
    values = context.launch_configurations
    ros = _files_for(values, executable, defaults)
    if values["log_level"]:
        # Set the level of this logger only: the loggers of ROS itself log too much.
        logger = f"{values['namespace']}/{executable}".strip("/").replace("/", ".")
        ros += ["--log-level", f"{logger}:={values['log_level']}"]
    # Through RViz, people command drones.
    enclave = "operator" if executable == "rviz2" else executable
    parameters: dict[str, Any] = {
        **{
            name: LaunchConfiguration(argument)
            for name, argument in names.items()
            if values[argument]
        },
        **(fixed or {}),
    }
    return Node(
        executable=executable,
        # Parameters under its full name override those that a file gives to several nodes.
        name=executable,
        namespace=values["namespace"],
        parameters=[parameters] if parameters else None,
        ros_arguments=[*ros, "--enclave", f"{values['enclaves'].rstrip('/')}/{enclave}"],
        output="screen",
        # An interrupted bridge first makes its vehicles hold, and DDS needs time too.
        sigterm_timeout="20",
        **{
            "package": "dsse_ros",
            # The mission continues without a node that only watches: RViz closed, the disk full.
            "on_exit": _note_failure if executable in _WATCHERS else _end,
            **options,
        },
    )


def _files_for(values: Mapping[str, str], executable: str, defaults: Sequence[str]) -> list[str]:
    """Return the arguments for the files that have parameters of a node.

    A node refuses a file that has parameters of other nodes only.

    Raises:
        FieldError: If a file has parameters, and of no node that a launch may start.
    """
    files = [str(_share() / "config" / name) for name in defaults]
    if values["params_file"]:
        files.append(values["params_file"])
    # As arguments, because launch skips a file that does not exist.
    ros = [part for file in files for part in ("--params-file", file)]
    root = f"/{values['namespace'].strip('/')}".rstrip("/")
    check_reached([f"{root}/{name}" for name in _NODES], ros)
    return reaching([f"{root}/{executable}"], ros)


def leave_to_bridge(event: Any, context: LaunchContext) -> Shutdown | None:
    """Note that a node has failed; the bridge goes on for the vehicles and their operator.

    Raises:
        RuntimeError: If the node has refused its parameters: then no vehicle has taken off.
    """
    if event.returncode == BAD_INPUT:
        return _end(event, context)
    _note_failure(event, context)
    return None


def _end(event: Any, context: LaunchContext) -> Shutdown | None:
    """Shut down; a node that has failed makes the launch fail."""
    if context.is_shutdown:
        return None
    _note_failure(event, context)
    if failure := context.get_locals_as_dict().get(_FAILURE):
        raise RuntimeError(failure)
    return Shutdown(reason=f"{event.process_name} has ended")


def _note_failure(event: Any, context: LaunchContext) -> None:
    """Note that a node has failed, for the end of the launch."""
    # Ctrl-C can reach a process before Python has begun to handle it.
    if event.returncode not in (0, -signal.SIGINT) and not context.is_shutdown:
        failure = f"{event.process_name} ended with code {event.returncode}"
        context.extend_globals({_FAILURE: failure})


def _share() -> Path:
    return Path(get_package_share_directory("dsse_ros"))

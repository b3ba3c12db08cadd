# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Launch descriptions from tables of arguments."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, List  # noqa: UP035

from ament_index_python.packages import get_package_prefix, get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from dsse_ros.nodes.launch_arguments import Argument, Start, starts

_WATCHERS = ("recorder", "foxglove_viewer", "rviz2")


def describe(arguments: Mapping[str, Argument]) -> LaunchDescription:
    """Return the description of `MISSION` or `FLIGHT`: arguments, then nodes."""
    given: set[str] = set()

    def note_given(context: LaunchContext) -> None:
        # Once an argument is declared, its default looks like a given value.
        given.update(arguments.keys() & context.launch_configurations.keys())

    def nodes(context: LaunchContext) -> list[Node]:
        texts = {name: context.launch_configurations[name] for name in arguments}
        share = get_package_share_directory("dsse_ros")
        made = starts(arguments, texts, given, share)
        for package in {_package(name) for name in made}:
            # Otherwise launch would start some nodes before it finds a package missing, and leave
            # them running.
            get_package_prefix(package)
        return [_node(name, start, texts["namespace"]) for name, start in made.items()]

    declared = [
        DeclareLaunchArgument(
            name,
            default_value=one.default,
            description=one.doc,
            choices=list(one.choices) or None,
        )
        for name, one in arguments.items()
    ]
    return LaunchDescription(
        [OpaqueFunction(function=note_given), *declared, OpaqueFunction(function=nodes)]
    )


def _node(executable: str, start: Start, namespace: str) -> Node:
    files = [Path(file) for file in start.files]
    parameters = [_typed(start.before), *files, _typed(start.after)]
    return Node(
        package=_package(executable),
        executable=executable,
        namespace=namespace,
        parameters=[one for one in parameters if one],
        arguments=list(start.arguments),
        output="screen",
        # An interrupted bridge first makes its vehicles hold, and DDS needs time too.
        sigterm_timeout="20",
        # The mission continues if a node that only watches ends: RViz is closed, the disk is full.
        on_exit=None if executable in _WATCHERS else Shutdown(reason=f"{executable} has ended"),
    )


def _package(executable: str) -> str:
    return "rviz2" if executable == "rviz2" else "dsse_ros"


def _typed(parameters: Mapping[str, Any]) -> dict[str, ParameterValue]:
    """Return parameters that keep their types: launch would parse a text as YAML again."""
    return {name: ParameterValue(one, value_type=_type(one)) for name, one in parameters.items()}


def _type(value: Any) -> Any:
    # For launch_ros, list[int] is a different type than List[int].
    if isinstance(value, list):
        return List[int] if isinstance(value[0], int) else List[str]  # noqa: UP006
    return type(value)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parses the arguments after --ros-args without ROS.

rcl merges the parameters of all files and of -p. The merged result does not show which parameters
were for that node and which for all nodes (design.ros2.org, "ROS Command Line Arguments" and
"Parameter files").
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import yaml

if TYPE_CHECKING:
    # `ros2 launch` imports this too, perhaps without the dependencies of the search.
    from dsse_ros.scenario.fields import Spec

OF_EVERY_NODE = ("use_sim_time", "start_type_description_service")
"""Parameters that every ROS 2 node has."""

_BEGIN, _END = "--ros-args", "--"


class UnreadableFileError(ValueError):
    """A file that cannot be read as a file of parameters."""


class Given(NamedTuple):
    """A parameter that a node is started with.

    Attributes:
        value: The value parsed from YAML.
        shared: Whether it is only in sections of files for several nodes, such as `/**`.
    """

    value: Any
    shared: bool


def split_ros_arguments(arguments: Iterable[str]) -> tuple[list[str], list[str]]:
    """Return a program's own arguments, and those between --ros-args and -- or the end."""
    own: list[str] = []
    ros: list[str] = []
    into = own
    for argument in arguments:
        if argument == _BEGIN:
            into = ros
        elif argument == _END and into is ros:
            into = own
        else:
            into.append(argument)
    return own, ros


def pairs(ros: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Return the flags of what follows --ros-args, each with its value, "" for none."""
    arguments = iter(ros)
    for argument in arguments:
        takes_one = argument in _LONG or argument in _LONG.values() or argument in _WITH_VALUE
        yield _LONG.get(argument, argument), next(arguments, "") if takes_one else ""


_LONG = {"-p": "--param", "-r": "--remap", "-e": "--enclave"}
_WITH_VALUE = ("--params-file", "--log-level", "--log-config-file", "--log-file-name")


def namespace_of(ros: Sequence[str]) -> str:
    """Return the namespace that a remap rule asks for, "" for none."""
    namespace = ""
    for flag, value in pairs(ros):
        name, _, target = value.partition(":=")
        if flag == "--remap" and name in ("__ns", "ns"):
            namespace = target.rstrip("/")
    return namespace


def parameters_for(node: str, ros: Sequence[str]) -> dict[str, Given]:
    """Return the parameters given to a node; the last value of each counts, as in rcl.

    Args:
        node: Full name of the node.
        ros: The arguments after --ros-args.

    Raises:
        UnreadableFileError: If a file cannot be read, or is not a file of parameters.
    """
    found: dict[str, Given] = {}
    for flag, value in pairs(ros):
        if flag == "--param":
            names, _, text = value.partition(":=")
            *nodes, name = names.split(":")
            if not nodes or _is_for(nodes[0], node):
                found[name] = Given(_yaml(text), shared=False)
        elif flag == "--params-file":
            for pattern, parameters in _sections(value):
                if _is_for(pattern, node):
                    shared = pattern.endswith("*")
                    for name, one in parameters.items():
                        own = name in found and not found[name].shared
                        found[name] = Given(one, shared and not own)
    return found


def _sections(path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the node patterns in a file of parameters, each with its parameters."""
    try:
        with open(path, encoding="utf-8") as file:
            content = yaml.safe_load(file)
    except OSError as error:
        raise UnreadableFileError(f"{path}: {error.strerror}") from None
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        raise UnreadableFileError(f"{path}: not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(content, Mapping):
        raise UnreadableFileError(f"{path}: not a file of parameters")
    yield from _below("", content)


def _below(name: str, part: Mapping[Any, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for key, value in part.items():
        if isinstance(value, Mapping):
            if key == "ros__parameters":
                yield name, dict(_flat("", value))
            else:
                yield from _below(f"{name}/{str(key).strip('/')}", value)


def _flat(prefix: str, part: Mapping[Any, Any]) -> Iterator[tuple[str, Any]]:
    for key, value in part.items():
        if isinstance(value, Mapping):
            yield from _flat(f"{prefix}{key}.", value)
        else:
            yield f"{prefix}{key}", value


def _is_for(pattern: str, node: str) -> bool:
    """Return whether a pattern matches a node: `*` is one part of its name, `**` any number."""
    wild = {"*": "/[^/]+", "**": "(/[^/]+)*"}
    parts = [wild.get(part, "/" + re.escape(part)) for part in pattern.strip("/").split("/")]
    return re.fullmatch("".join(parts), "/" + node.strip("/")) is not None


def _yaml(text: str) -> Any:
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError:
        return text


def from_ros(spec: Spec, value: Any) -> Any:
    """Return a parameter's value in the shape of the field: cells come as [col, row, ...]."""
    if spec.kind == "cells" and isinstance(value, Iterable) and not isinstance(value, str | bytes):
        flat = list(value)
        if flat and len(flat) % 2 == 0 and not any(isinstance(v, list | tuple) for v in flat):
            return [flat[i : i + 2] for i in range(0, len(flat), 2)]
    return value

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The arguments after --ros-args and the parameters in them, without ROS."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from dsse_ros.base.fields import FieldError, Spec, check_known, shown
from dsse_ros.world.scenario.yaml_file import LeadingZeroError, parse_yaml, read_yaml

OF_EVERY_NODE = ("use_sim_time", "start_type_description_service")
"""Parameters that every ROS 2 node has."""

NO_NAMES: Mapping[str, str] = MappingProxyType({})

_BEGIN, _END = "--ros-args", "--"


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


def typed_names(ros: Sequence[str]) -> frozenset[str]:
    """Return the names of the parameters given with -p, for any node or for one."""
    return frozenset(
        value.partition(":=")[0].rpartition(":")[2]
        for flag, value in pairs(ros)
        if flag == "--param"
    )


def full_name(node: str, ros: Sequence[str]) -> str:
    """Return the fully qualified name that a node gets by what follows --ros-args."""
    namespace = ""
    for flag, value in pairs(ros):
        rule, _, to = value.partition(":=")
        owner, _, what = rule.rpartition(":")
        if flag == "--remap" and owner in ("", node):
            if what == "__ns":
                namespace = to.rstrip("/")
            elif what in ("__node", "__name"):
                node = to
    return f"{namespace}/{node}"


def check_reached(nodes: Collection[str], ros: Sequence[str]) -> None:
    """Check that parameters are for one of some nodes: ROS ignores those for others.

    Args:
        nodes: Fully qualified names of the nodes.
        ros: The arguments after --ros-args.

    Raises:
        FieldError: If a file has parameters of other nodes only, an argument is for another node,
            or a number begins with 0.
    """
    known = " and ".join(sorted(nodes))
    for flag, value in pairs(ros):
        if flag == "--param":
            name, _, text = value.partition(":=")
            node = name.rpartition(":")[0]
            if not _reaches(nodes, flag, value):
                raise FieldError(f"{shown(value)} must be for {known}, got a parameter of /{node}")
            try:
                parse_yaml(text)
            except LeadingZeroError as error:
                raise FieldError(f"{name}: {error}") from None
            except FieldError:
                # ROS says what is wrong, or takes it.
                continue
        elif flag == "--params-file" and not _reaches(nodes, flag, value):
            others = ", ".join(_nodes_of(value))
            raise FieldError(f"params-file {shown(value)} must have parameters of {known}, got "
                             f"those of {others}")  # fmt: skip


def reaching(nodes: Collection[str], ros: Sequence[str]) -> list[str]:
    """Return the arguments after --ros-args without parameters for other nodes only."""
    kept: list[str] = []
    for flag, value in pairs(ros):
        if _reaches(nodes, flag, value):
            kept += [flag, value] if value else [flag]
    return kept


def _reaches(nodes: Collection[str], flag: str, value: str) -> bool:
    """Return whether an argument after --ros-args is for one of these nodes."""
    if flag == "--param":
        node = value.partition(":=")[0].rpartition(":")[0]
        return not node or f"/{node}" in nodes
    if flag == "--params-file":
        patterns = _nodes_of(value)
        return not patterns or any(
            re.fullmatch(_regex_of(pattern), node) for pattern in patterns for node in nodes
        )
    return True


def _nodes_of(path: str) -> list[str]:
    """Return the names of nodes in a file of parameters; none if ROS has to say what is wrong.

    Raises:
        FieldError: If a number begins with 0.
    """
    try:
        return list(_named(read_yaml(path), ""))
    except LeadingZeroError as error:
        raise FieldError(f"params-file {shown(path)}: {error}") from None
    except FieldError:
        return []


def _named(values: Any, name: str) -> Iterator[str]:
    if isinstance(values, Mapping):
        if "ros__parameters" in values:
            yield name
        for part, inner in values.items():
            if part != "ros__parameters":
                yield from _named(inner, f"{name}/{str(part).strip('/')}")


def _regex_of(name: str) -> str:
    """Return a pattern of the names of nodes that rcl counts to one in a file."""
    return "".join(
        {"/**": r"(/\w+)*", "*": r"\w+"}.get(part, re.escape(part))
        for part in re.split(r"(/\*\*|\*)", name)
    )


def known_parameters(
    what: str,
    values: Mapping[str, Any],
    known: Collection[str],
    typed: Collection[str],
    full_names: Mapping[str, str] = NO_NAMES,
) -> dict[str, Any]:
    """Return those of the given parameters that are known; a file may have those of other nodes.

    Args:
        what: Whose parameters they are, for the error.
        values: Values by name.
        known: The known names.
        typed: Names that are not from a file. Those, and all with a prefix of known names, must be
            known.
        full_names: Names without their group, with the full ones; never allowed.

    Raises:
        FieldError: If a name is not allowed.
    """
    prefixes = {name.partition(".")[0] for name in known if "." in name}
    kept = {}
    for name, value in values.items():
        if name in known:
            kept[name] = value
        elif name in full_names or name in typed or name.partition(".")[0] in prefixes:
            check_known(what, [name], sorted(known), full_names)
    return kept


def without_prefix(prefix: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of a group, by the names that follow its prefix."""
    return {
        name.removeprefix(prefix): value
        for name, value in values.items()
        if name.startswith(prefix)
    }


def from_ros(spec: Spec, value: Any) -> Any:
    """Return a parameter's value in the shape of the field: cells come as [col, row, ...]."""
    if spec.kind == "cells" and isinstance(value, Iterable) and not isinstance(value, str | bytes):
        flat = list(value)
        if flat and len(flat) % 2 == 0 and not any(isinstance(v, list | tuple) for v in flat):
            return [flat[i : i + 2] for i in range(0, len(flat), 2)]
    return value

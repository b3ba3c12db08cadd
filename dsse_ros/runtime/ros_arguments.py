# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The arguments after --ros-args and the parameters in them, without ROS."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from dsse_ros.scenario.fields import Spec, check_known

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

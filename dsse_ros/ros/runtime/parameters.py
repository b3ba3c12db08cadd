# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Checked fields as ROS parameters: read the given values, declare the effective ones."""

from __future__ import annotations

import re
import sys
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    ParameterType,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from dsse_ros.base.fields import FieldError, Spec, shown
from dsse_ros.ros.runtime.ros_arguments import OF_EVERY_NODE, from_ros

_TYPES = {
    "bool": Parameter.Type.BOOL,
    "int": Parameter.Type.INTEGER,
    "float": Parameter.Type.DOUBLE,
    "str": Parameter.Type.STRING,
    "vector": Parameter.Type.DOUBLE_ARRAY,
    "floats": Parameter.Type.DOUBLE_ARRAY,
    "ints": Parameter.Type.INTEGER_ARRAY,
    "cell": Parameter.Type.INTEGER_ARRAY,
    "cells": Parameter.Type.INTEGER_ARRAY,
    "grid": Parameter.Type.INTEGER_ARRAY,
    "extent": Parameter.Type.DOUBLE_ARRAY,
    "names": Parameter.Type.STRING_ARRAY,
    "custom": Parameter.Type.STRING,
}

QOS_PREFIX = "qos_overrides."
"""Prefix of the parameters that override the QoS of a topic."""

# rclpy's own subscription when use_sim_time is set.
_CLOCK_PREFIX = f"{QOS_PREFIX}/clock.subscription."
_NESTED_LIST = re.compile(r"\s*\[[^'\"]*\[")


def declarable(
    name: str, value: Any = None, descriptor: ParameterDescriptor | None = None
) -> tuple[str, Any, ParameterDescriptor]:
    """Return the parameter in a form that rclpy can declare; None needs a dynamic type.

    Raises:
        FieldError: If a parameter that every node has is not true or false.
    """
    if name in OF_EVERY_NODE:
        value = Spec("bool", "").check(name, [] if value is None else value)
    described = descriptor or ParameterDescriptor()
    if value is None:
        described.dynamic_typing = True
    return name, value, described


def overrides(node: Node) -> dict[str, Any]:
    """Return the parameters a node was started with; they are undeclared.

    The node must have been made with `automatically_declare_parameters_from_overrides`, so that
    values of any type arrive here and are checked in one place.
    """
    stated = {
        # A parameter without a type was given as an empty list.
        name: [] if (value := node.get_parameter(name).value) is None else value
        for name in node.get_parameters_by_prefix("")
        if name not in OF_EVERY_NODE and not name.startswith(_CLOCK_PREFIX)
    }
    for name in stated:
        node.undeclare_parameter(name)
    return stated


def check_flat(arguments: Iterable[str]) -> None:
    """Refuse a nested list on the command line: rcl would keep the last inner list only.

    Raises:
        FieldError: If there is one.
    """
    for argument in arguments:
        name, _, value = argument.partition(":=")
        if _NESTED_LIST.match(value):
            raise FieldError(f"{name} must be a flat list [col0, row0, ...], got {shown(value)}")


def to_ros(spec: Spec, value: Any) -> Any:
    """Return a field's value as a parameter holds it."""
    if spec.kind == "custom":
        return "" if value is None else value.to_text()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if spec.kind == "cells":
        return [part for cell in value for part in cell]
    return list(value)


def descriptor(name: str, spec: Spec, *, read_only: bool) -> ParameterDescriptor:
    """Return the descriptor of a field: sentence, unit, range, allowed values."""
    described = ParameterDescriptor(
        name=name,
        type=_TYPES[spec.kind].value,
        description=f"{spec.doc} Unit: {spec.unit}." if spec.unit else spec.doc,
        additional_constraints=spec.allowed(),
        read_only=read_only,
    )
    low, high = max(spec.low, spec.above), spec.high
    bounded = low > float("-inf") or high < float("inf")
    if spec.kind == "int" and bounded:
        described.integer_range = [
            IntegerRange(
                from_value=int(max(low, -(2.0**62))), to_value=int(min(high, 2.0**62)), step=1
            )
        ]
    elif spec.kind == "float" and bounded:
        limit = sys.float_info.max
        described.floating_point_range = [
            FloatingPointRange(
                from_value=float(max(low, -limit)), to_value=float(min(high, limit)), step=0.0
            )
        ]
    return described


def declare(
    node: Node, specs: Mapping[str, Spec], values: Mapping[str, Any], mutable: Collection[str] = ()
) -> None:
    """Declare one parameter per field with its effective value; None can be read too."""
    for name, spec in specs.items():
        described = descriptor(name, spec, read_only=name not in mutable)
        value = to_ros(spec, values[name])
        if value is None or value == []:
            # A parameter with a type but no value would break a request for all parameters.
            value, described.dynamic_typing, described.type = (
                None,
                True,
                ParameterType.PARAMETER_NOT_SET,
            )
        node.declare_parameter(name, value, described, ignore_override=True)


def check_changes(
    specs: Mapping[str, Spec], parameters: Iterable[Parameter]
) -> tuple[SetParametersResult, dict[str, Any]]:
    """Return the verdict on a change of parameters, and the values of the fields it sets."""
    changes: dict[str, Any] = {}
    try:
        for parameter in parameters:
            if parameter.name in specs:
                spec = specs[parameter.name]
                value = from_ros(spec, parameter.value)
                changes[parameter.name] = spec.check(parameter.name, value)
    except FieldError as error:
        return SetParametersResult(successful=False, reason=str(error)), {}
    return SetParametersResult(successful=True), changes

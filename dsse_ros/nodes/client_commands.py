# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Converts commands and service requests from clients of a viewer to ROS messages."""

from __future__ import annotations

import json
import re
from typing import Any

from rclpy.serialization import deserialize_message, serialize_message

from dsse_ros.nodes.operator_services import OPERATOR_SERVICES
from dsse_ros.recording.schemas import message_class
from dsse_ros.search import FieldError

ENCODINGS = ("json", "cdr")
"""Encodings that clients may send; a client uses the first one that it supports.

Foxglove writes CDR with the definitions of ROS 1 unless the server declares ROS 2, which this SDK
cannot do.
"""
_TYPES = {
    "joint_action": "std_msgs/msg/Int32MultiArray",
    r"drone\d+/cmd_action": "std_msgs/msg/Int8",
    r"drone\d+/cmd_action_name": "std_msgs/msg/String",
    r"drone\d+/command_pose": "geometry_msgs/msg/PoseStamped",
    r"drone\d+/command_path": "nav_msgs/msg/Path",
}
_NOTHING = {"type": "object", "properties": {}}
_FLAG = {"type": "object", "properties": {"data": {"type": "boolean"}}, "required": ["data"]}
_RESPONSE = {
    "type": "object",
    "properties": {"success": {"type": "boolean"}, "message": {"type": "string"}},
}
SERVICE_SCHEMAS = {
    what: (
        (f"std_srvs/srv/{kind.__name__}_Request", json.dumps(_FLAG if what == "arm" else _NOTHING)),
        (f"std_srvs/srv/{kind.__name__}_Response", json.dumps(_RESPONSE)),
    )
    for what, kind in OPERATOR_SERVICES.items()
}
"""Names and JSON schemas of request and response, for each operator service."""
_SEQUENCE = re.compile(r"sequence<(.+?)(, \d+)?>")
# Field names of a stamp and of a header in ROS 1 and in Foxglove, and their names in ROS 2.
_OTHER_NAMES = {"nsec": "nanosec", "nsecs": "nanosec", "secs": "sec", "seq": None}


def command_type(namespace: str, topic: str) -> str:
    """Return the type of the messages on a topic of commands.

    Args:
        namespace: Namespace of the mission, with a slash at both ends.
        topic: Full name.

    Raises:
        FieldError: If the mission has no such command topic.
    """
    for pattern, type_name in _TYPES.items():
        if topic.startswith(namespace) and re.fullmatch(pattern, topic.removeprefix(namespace)):
            return type_name
    raise FieldError(f"topic must be one of commands in {namespace}, got {topic!r}")


def check_offer(type_name: str, schema_name: str, encoding: str) -> None:
    """Check that a client offers messages of this type in a supported encoding.

    Raises:
        FieldError: If it does not.
    """
    if encoding not in ENCODINGS:
        raise FieldError(f"encoding must be one of {', '.join(ENCODINGS)}, got {encoding!r}")
    # Foxglove leaves out `/msg/`, which ROS 1 did not have.
    if schema_name not in (type_name, type_name.replace("/msg/", "/")):
        raise FieldError(f"type must be {type_name}, got {schema_name!r}")


def read_command(type_name: str, encoding: str, data: bytes) -> Any:
    """Return a command as a message.

    Args:
        type_name: Type of the message.
        encoding: One of `ENCODINGS`.
        data: Bytes from the client.

    Raises:
        FieldError: If the bytes are not such a message.
    """
    kind = message_class(type_name)
    if encoding == "cdr":
        try:
            return deserialize_message(data, kind)
        except Exception as error:
            # rclpy raises errors of its middleware without a class of their own.
            raise FieldError(f"{type_name}: no such message: {_line(error)}") from None
    message = _message(type_name, _json(type_name, data))
    try:
        # A text may not be valid UTF-8.
        serialize_message(message)
    except Exception as error:
        raise FieldError(f"{type_name}: no such message: {_line(error)}") from None
    return message


def read_request(what: str, data: bytes) -> Any:
    """Return a client's call of an operator service as a request.

    Args:
        what: One of `OPERATOR_SERVICES`.
        data: JSON from the client.

    Raises:
        FieldError: If the bytes are not such a request.
    """
    name = SERVICE_SCHEMAS[what][0][0]
    values = _json(name, data or b"{}")
    request = _filled(OPERATOR_SERVICES[what].Request(), name, values)
    missing = [field for field in request.get_fields_and_field_types() if field not in values]
    if missing:
        # Whether vehicles may fly must not depend on a default.
        raise FieldError(f"{name}: {', '.join(missing)}: missing")
    return request


def response_bytes(response: Any) -> bytes:
    """Return the response of an operator service as JSON."""
    return json.dumps({"success": response.success, "message": response.message}).encode()


def _json(type_name: str, data: bytes) -> Any:
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        raise FieldError(f"{type_name}: not JSON: {_line(error)}") from None


def _message(type_name: str, values: Any) -> Any:
    """Return a message with the fields of a JSON object; missing fields keep their defaults.

    Raises:
        FieldError: If a field or a value does not fit the type.
    """
    return _filled(message_class(type_name)(), type_name, values)


def _filled(message: Any, type_name: str, values: Any) -> Any:
    """Return a message of this type with the fields of a JSON object.

    Raises:
        FieldError: If a field or a value does not fit the type.
    """
    if not isinstance(values, dict):
        raise FieldError(f"{type_name} must be an object, got {_short(values)}")
    kinds = message.get_fields_and_field_types()
    for given, value in values.items():
        name = given if given in kinds else _OTHER_NAMES.get(given, given)
        if name is None:
            continue
        if name not in kinds:
            raise FieldError(f"{type_name}: field must be one of {', '.join(kinds)}, got {given!r}")
        try:
            setattr(message, name, _value(kinds[name], value))
        except FieldError:
            raise
        except (AssertionError, OverflowError, TypeError, ValueError):
            raise FieldError(
                f"{type_name}: {name} must be {kinds[name]}, got {_short(value)}"
            ) from None
    return message


def _value(kind: str, value: Any) -> Any:
    """Convert a JSON value to the type of a field.

    Raises:
        FieldError, OverflowError, TypeError, ValueError: If it does not fit.
    """
    if match := _SEQUENCE.fullmatch(kind):
        if not isinstance(value, list):
            raise TypeError
        return [_value(match[1], item) for item in value]
    if "/" in kind:
        package, name = kind.split("/")
        return _message(f"{package}/msg/{name}", value)
    if kind in ("float", "double"):
        return float(_number(value, int | float))
    if "int" in kind:
        whole: int = _number(value, int)
        unsigned, bits = kind.startswith("u"), int(kind.lstrip("uint"))
        low = 0 if unsigned else -(1 << bits - 1)
        if not low <= whole < low + (1 << bits):
            raise OverflowError
        return whole
    if not isinstance(value, bool if kind == "boolean" else str):
        raise TypeError
    return value


def _number(value: Any, allowed: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, allowed):
        raise TypeError
    return value


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _line(error: object) -> str:
    return " ".join(str(error).split())

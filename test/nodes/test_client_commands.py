# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands as clients of a viewer send them."""

from __future__ import annotations

import json
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Path
from rclpy.serialization import serialize_message
from std_msgs.msg import Int32MultiArray

from dsse_ros.nodes.client_commands import check_offer, command_type, read_command
from dsse_ros.search import FieldError

POSE, PATH = "geometry_msgs/msg/PoseStamped", "nav_msgs/msg/Path"
NUMBERS, TEXT = "std_msgs/msg/Int32MultiArray", "std_msgs/msg/String"
FIELDS = st.sampled_from(["data", "header", "stamp", "sec", "frame_id", "pose", "poses", "layout"])
ANY_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(st.characters()),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(FIELDS, inner, max_size=3),
    max_leaves=6,
)


@pytest.mark.parametrize("kind", [POSE, PATH, NUMBERS, TEXT])
@given(values=ANY_JSON)
def test_any_json_is_a_message_that_can_be_sent_or_refused_on_one_line(
    kind: str, values: Any
) -> None:
    try:
        message = read_command(kind, "json", json.dumps(values).encode())
    except FieldError as error:
        assert "\n" not in str(error)
    else:
        serialize_message(message)


@given(data=st.binary(max_size=80))
def test_any_bytes_are_a_message_or_refused_on_one_line(data: bytes) -> None:
    for encoding in ("json", "cdr"):
        try:
            read_command(TEXT, encoding, data)
        except FieldError as error:
            assert "\n" not in str(error)


def test_json_is_read_as_the_message_that_cdr_is() -> None:
    pose = PoseStamped()
    pose.header.frame_id, pose.header.stamp.nanosec = "map", 5
    pose.pose.position.x = 2.0
    path, numbers = Path(poses=[pose]), Int32MultiArray(data=[1, -2])
    values = {
        "header": {"frame_id": "map", "stamp": {"nanosec": 5}},
        "pose": {"position": {"x": 2}},
    }
    for kind, message, given_values in (
        (POSE, pose, values),
        (PATH, path, {"poses": [values]}),
        (NUMBERS, numbers, {"data": [1, -2]}),
    ):
        assert read_command(kind, "json", json.dumps(given_values).encode()) == message
        assert read_command(kind, "cdr", serialize_message(message)) == message


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ([], r"must be an object, got \[\]"),
        ({"goal": 1}, "must be one of header, pose, got 'goal'"),
        ({"pose": {"position": {"x": "1"}}}, "x must be double, got '1'"),
        ({"pose": {"position": {"x": True}}}, "x must be double, got True"),
        ({"header": {"stamp": {"nanosec": -1}}}, "nanosec must be uint32, got -1"),
        ({"header": {"frame_id": 7}}, "frame_id must be string, got 7"),
        ({"header": {"frame_id": "\ud800"}}, "no such message"),
    ],
)
def test_what_is_wrong_is_named(values: Any, line: str) -> None:
    with pytest.raises(FieldError, match=line):
        read_command(POSE, "json", json.dumps(values).encode())


def test_only_commands_of_the_own_mission_are_taken() -> None:
    assert command_type("/a/", "/a/drone12/command_pose") == POSE
    assert command_type("/", "/joint_action") == NUMBERS
    for topic in (
        "/drone0/command_pose",
        "/a/b/drone0/command_pose",
        "/a/agents",
        "/a/drone0/pose",
    ):
        with pytest.raises(FieldError, match="topic"):
            command_type("/a/", topic)


def test_the_type_may_be_named_as_in_ros_1() -> None:
    check_offer(POSE, POSE, "cdr")
    check_offer(POSE, "geometry_msgs/PoseStamped", "json")
    with pytest.raises(FieldError, match="type"):
        check_offer(POSE, PATH, "json")

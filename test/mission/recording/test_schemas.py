# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Definitions of message types, as two other readers understand them."""

from __future__ import annotations

import pytest
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from dsse_ros.base.fields import FieldError
from dsse_ros.base.message_types import message_class
from dsse_ros.mission.recording.schemas import definition

TYPES = (
    "diagnostic_msgs/msg/DiagnosticArray", "geometry_msgs/msg/PoseArray",
    "geometry_msgs/msg/PoseStamped", "nav_msgs/msg/OccupancyGrid", "nav_msgs/msg/Odometry",
    "nav_msgs/msg/Path", "rosgraph_msgs/msg/Clock", "sensor_msgs/msg/Image",
    "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/PointCloud2", "std_msgs/msg/Int32MultiArray",
    "std_msgs/msg/Int8", "std_msgs/msg/String", "visualization_msgs/msg/MarkerArray",
)  # fmt: skip
JAZZY = get_typestore(Stores.ROS2_JAZZY)


@pytest.mark.parametrize("name", TYPES)
def test_a_definition_is_that_of_ros_2(name: str) -> None:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition(name), name))
    assert store.hash_rihs01(name) == JAZZY.hash_rihs01(name)


@pytest.mark.parametrize("name", TYPES)
def test_a_message_of_the_class_is_one_of_the_definition(name: str) -> None:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition(name), name))
    kind = message_class(name)
    read = store.deserialize_cdr(bytes(serialize_message(kind())), name)
    # Not the bytes: rclpy leaves those between two fields as they are.
    assert deserialize_message(bytes(store.serialize_cdr(read, name)), kind) == kind()


@pytest.mark.parametrize("name", ["nothing/msg/Such", "std_msgs/msg/Nothing", "std_msgs/String"])
def test_a_type_that_is_not_installed_is_named(name: str) -> None:
    for look_up in (definition, message_class):
        with pytest.raises(FieldError, match=f"type must be .*, got '{name}'"):
            look_up(name)

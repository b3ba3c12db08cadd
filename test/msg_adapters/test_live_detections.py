# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Detections of other nodes become inputs, and contacts become markers."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped

from dsse_ros.base.result import Accepted, Rejected
from dsse_ros.mission.live.inputs import read
from msg_adapters.live import contact_markers, detection_of_pose, detections_of_array
from msg_adapters.stamps import header, to_stamp


def pose(variance: float = 400.0, x: float = 3.0) -> PoseWithCovarianceStamped:
    message = PoseWithCovarianceStamped(header=header("map", to_stamp(1_500_000_000)))
    message.pose.pose.position.x, message.pose.pose.position.y = x, 4.0
    message.pose.covariance[0] = message.pose.covariance[7] = variance
    return message


def test_a_pose_is_a_detection_with_an_id_of_its_drone_and_stamp() -> None:
    found = detection_of_pose("drone1", pose())
    values = {"id": "drone1@1500000000", "drone": "drone1", "time": 1.5, "x": 3.0, "y": 4.0,
              "radius": 20.0}  # fmt: skip
    assert (found.frame_id, found.values) == ("map", values)
    assert isinstance(read("detection", found.values), Accepted)


@pytest.mark.parametrize("bad", [pose(math.nan), pose(-1.0), pose(0.0), pose(x=math.inf)])
def test_a_pose_without_a_place_or_its_uncertainty_is_refused(bad: Any) -> None:
    refused = read("detection", detection_of_pose("drone0", bad).values)
    assert isinstance(refused, Rejected) and refused.code == "bad_value"


def test_the_best_hypothesis_of_each_detection_in_an_array_counts() -> None:
    # The wheels of ROS 2 do not include vision_msgs.
    def result(score: float, x: float) -> SimpleNamespace:
        return SimpleNamespace(hypothesis=SimpleNamespace(score=score), pose=pose(x=x).pose)

    none = header("", to_stamp(0))
    array = SimpleNamespace(
        header=pose().header,
        detections=[
            SimpleNamespace(header=none, id="", results=[result(0.2, 1.0), result(0.9, 2.0)]),
            SimpleNamespace(header=none, id="track7", results=[result(0.5, 5.0)]),
            SimpleNamespace(header=none, id="", results=[]),
        ],
    )
    first, second = detections_of_array("drone0", array)
    assert (first.frame_id, first.values["x"], first.values["confidence"]) == ("map", 2.0, 0.9)
    assert [detection.values["id"] for detection in (first, second)] == [
        "drone0@1500000000#0", "drone0@1500000000#track7",
    ]  # fmt: skip


def test_the_markers_are_a_disc_and_a_name_for_each_contact() -> None:
    contact = {"contact": "c1", "state": "open", "x": 1.0, "y": 2.0, "radius": 50.0,
               "probability": 0.25}  # fmt: skip
    closed = {**contact, "contact": "c2", "state": "dismissed", "probability": None}
    first, *markers = contact_markers(pose().header, [contact, closed], 130.0).markers
    assert first.action == first.DELETEALL and len(markers) == 4
    assert [marker.text for marker in markers] == ["", "c1 25%", "", "c2"]
    assert markers[0].scale.x == 100.0

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is known of a vehicle, as messages and back."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from hypothesis import given
from hypothesis import strategies as st

from dsse_ros.result import Accepted, Rejected
from dsse_ros.scenario.frames import GridFrame
from dsse_ros.scenario.geodesy import map_to_geodetic
from msg_adapters.vehicles import (
    Progress,
    place_from_pose,
    progress_from_message,
    vehicle_fix,
    vehicle_pose,
    vehicle_state_message,
)

FRAME = GridFrame(20, 130.0, -24.04, -46.17, 7.0, 120.0)
STAMP = Time(sec=5, nanosec=6)
STAMPS = st.integers(-1, 2**62)
# ROS strings hold no zero.
TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=30)


def state_message(progress: Progress, **values: object) -> DiagnosticArray:
    return vehicle_state_message(
        "drone1", "udp", STAMP, progress, level="ok", message="flies", values=values
    )


@given(STAMPS, STAMPS, TEXTS, st.integers(0, 2**32 - 1))
def test_the_progress_that_is_published_is_read(
    report: int, arrived: int, lost: str, run_id: int
) -> None:
    progress = Progress(report, arrived, lost, run_id=run_id)
    message = state_message(progress, mode="GUIDED")
    assert progress_from_message(message, "drone1") == Accepted(progress)
    assert message.status[0].message == "flies" and message.header.stamp == STAMP


@given(st.dictionaries(st.sampled_from(["report_stamp_ns", "arrived_stamp_ns", "lost"]), TEXTS))
def test_any_other_text_is_refused_or_read_but_never_raises(values: dict[str, str]) -> None:
    message = state_message(Progress())
    for pair in message.status[0].values:
        pair.value = values.get(pair.key, pair.value)
    read = progress_from_message(message, "drone1")
    assert isinstance(read, Accepted) or (read.code == "bad_state" and "\n" not in read.reason)


def test_the_state_of_another_drone_is_none() -> None:
    read = progress_from_message(state_message(Progress()), "drone2")
    assert isinstance(read, Rejected) and read.code == "bad_state"
    assert isinstance(progress_from_message(DiagnosticArray(), "drone1"), Rejected)


@given(st.floats(-500, 3000), st.floats(-500, 3000), st.floats(0, 150), st.floats(0, 360))
def test_a_pose_is_where_the_vehicle_is(x: float, y: float, alt_m: float, heading: float) -> None:
    lat_deg, lon_deg, height_m = map_to_geodetic(FRAME, x, y, alt_m)
    pose = vehicle_pose(FRAME, lat_deg, lon_deg, height_m - FRAME.origin_alt_m, heading, STAMP)
    here, turn = pose.pose.position, pose.pose.orientation
    assert (here.x, here.y, here.z) == pytest.approx((x, y, alt_m), abs=1e-3)
    east, north = math.sin(math.radians(heading)), math.cos(math.radians(heading))
    yaw = 2 * math.atan2(turn.z, turn.w)
    assert (math.cos(yaw), math.sin(yaw)) == pytest.approx((east, north), abs=1e-9)
    assert place_from_pose(pose, FRAME) == Accepted((here.x, here.y))


def test_a_vehicle_that_does_not_know_its_heading_faces_east() -> None:
    pose = vehicle_pose(FRAME, -24.0, -46.1, 10.0, math.nan, STAMP)
    assert (pose.pose.orientation.z, pose.pose.orientation.w) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("change", "code"), [({"frame": "odom"}, "foreign_frame"), ({"x": math.inf}, "not_finite")]
)
def test_a_pose_that_is_nowhere_is_refused(change: dict[str, Any], code: str) -> None:
    pose = vehicle_pose(FRAME, -24.0, -46.1, 10.0, 0.0, STAMP)
    pose.header.frame_id = change.get("frame", "map")
    pose.pose.position.x = change.get("x", 0.0)
    read = place_from_pose(pose, FRAME)
    assert isinstance(read, Rejected) and read.code == code


def test_a_fix_says_that_its_error_is_not_known() -> None:
    frame = dataclasses.replace(FRAME, frame_prefix="one/")
    fix = vehicle_fix(frame, "drone3", -24.0, -46.1, 12.5, STAMP)
    assert (fix.latitude, fix.longitude, fix.altitude) == (-24.0, -46.1, 12.5)
    assert fix.header.frame_id == "one/drone3/base_link"
    assert fix.position_covariance_type == fix.COVARIANCE_TYPE_UNKNOWN

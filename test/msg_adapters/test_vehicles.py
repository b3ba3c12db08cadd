# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is known of a vehicle, as messages and back."""

from __future__ import annotations

import math

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from hypothesis import given
from hypothesis import strategies as st

from msg_adapters.poses import pose_from_message
from msg_adapters.stamps import header, to_nanoseconds
from msg_adapters.vehicles import (
    Progress,
    progress_from_message,
    vehicle_fix,
    vehicle_pose,
    vehicle_state_message,
    vehicle_time,
)

STAMP = Time(sec=5, nanosec=6)
STAMPS = st.integers(-1, 2**62)
# ROS strings hold no zero.
TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=30)


def state_message(progress: Progress, **values: object) -> DiagnosticArray:
    return vehicle_state_message(
        "drone1", "udp", STAMP, progress, level="ok", message="flies", values=values
    )


@given(st.lists(STAMPS, min_size=3, max_size=3), TEXTS, st.integers(0, 2**32 - 1))
def test_the_progress_that_is_published_is_read(tasks: list[int], lost: str, run_id: int) -> None:
    progress = Progress(*tasks, lost, run_id=run_id)
    message = state_message(progress, mode="GUIDED")
    assert progress_from_message(message, "drone1") == progress
    assert message.status[0].message == "flies" and message.header.stamp == STAMP


@given(st.dictionaries(st.sampled_from(["task", "looked_task", "arrived_task", "lost"]), TEXTS))
def test_any_other_text_is_read_or_refused_in_one_line(values: dict[str, str]) -> None:
    message = state_message(Progress())
    for pair in message.status[0].values:
        pair.value = values.get(pair.key, pair.value)
    try:
        progress_from_message(message, "drone1")
    except ValueError as error:
        assert "\n" not in str(error)


def test_the_state_of_another_drone_is_none() -> None:
    for message in (state_message(Progress()), DiagnosticArray()):
        with pytest.raises(ValueError, match="^status: none is named 'drone2'$"):
            progress_from_message(message, "drone2")


@given(st.floats(0, 360), st.floats(-3, 3), st.floats(-1.5, 1.5))
def test_a_pose_is_where_the_vehicle_is_and_how_it_lies(
    heading: float, roll: float, pitch: float
) -> None:
    attitude = (roll, pitch, heading)
    pose = pose_from_message(vehicle_pose(header("map", STAMP), (1.0, -2.0, 30.0), attitude))
    assert pose[:2] == ("map", (1.0, -2.0, 30.0))
    x, y, z, w = pose.orientation
    assert x * x + y * y + z * z + w * w == pytest.approx(1.0)
    # Where its nose and its left side point, in the map frame.
    nose = (1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w))
    left_up = 2 * (y * z + x * w)
    east, north = math.sin(math.radians(heading)), math.cos(math.radians(heading))
    assert nose == pytest.approx(
        (east * math.cos(pitch), north * math.cos(pitch), math.sin(pitch)), abs=1e-9
    )
    assert left_up == pytest.approx(math.sin(roll) * math.cos(pitch), abs=1e-9)


def test_a_vehicle_that_does_not_know_its_heading_faces_east() -> None:
    pose = vehicle_pose(header("map", STAMP), (0.0, 0.0, 10.0), (0.0, 0.0, math.nan))
    assert (pose.pose.orientation.z, pose.pose.orientation.w) == (0.0, 1.0)


@given(st.integers(0, 2**32 - 1))
def test_the_clock_of_a_vehicle_is_read_to_the_millisecond(boot_ms: int) -> None:
    message = vehicle_time(header("drone1/base_link", STAMP), "udp system 1", boot_ms * 1e-3)
    assert to_nanoseconds(message.time_ref) == boot_ms * 10**6
    assert message.header.stamp == STAMP and message.source == "udp system 1"


def test_a_fix_says_that_its_error_is_not_known() -> None:
    fix = vehicle_fix(header("one/drone3/base_link", STAMP), (-24.0, -46.1, 12.5))
    assert (fix.latitude, fix.longitude, fix.altitude) == (-24.0, -46.1, 12.5)
    assert fix.header.frame_id == "one/drone3/base_link"
    assert fix.position_covariance_type == fix.COVARIANCE_TYPE_UNKNOWN

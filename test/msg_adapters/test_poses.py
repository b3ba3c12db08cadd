# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drones as poses, odometry, tracks and fixes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import NavSatFix, NavSatStatus

from msg_adapters import poses
from msg_adapters.stamps import header, to_stamp

STAMP, LATER = to_stamp(13 * 10**9), to_stamp(26 * 10**9)
HEAD, LATER_HEAD = header("sea", STAMP), header("sea", LATER)
SPEEDS = st.floats(-40, 40).filter(lambda speed: speed == 0 or abs(speed) > 1e-6)
METRES = st.floats(-1e6, 1e6)
POSITIONS = st.tuples(METRES, METRES, METRES)
TRACKS = st.lists(POSITIONS, max_size=8)


def xyz(position):
    return position.x, position.y, position.z


@given(POSITIONS)
def test_a_position_comes_back_from_its_pose(position):
    message = poses.pose_stamped(HEAD, position)
    assert message.header == HEAD
    assert poses.pose_from_message(message) == ("sea", position, (0.0, 0.0, 0.0, 1.0))


@given(POSITIONS, SPEEDS, SPEEDS)
def test_odometry_turned_back_into_the_map_frame_is_the_velocity(position, east, north):
    message = poses.odometry(HEAD, "a/drone3/base_link", position, (east, north))
    assert (message.header, message.child_frame_id) == (HEAD, "a/drone3/base_link")
    assert xyz(message.pose.pose.position) == position
    turn, speed = message.pose.pose.orientation, message.twist.twist.linear
    assert math.hypot(turn.x, turn.y, turn.z, turn.w) == pytest.approx(1)
    yaw = 2 * math.atan2(turn.z, turn.w)
    in_map = (
        speed.x * math.cos(yaw) - speed.y * math.sin(yaw),
        speed.x * math.sin(yaw) + speed.y * math.cos(yaw),
    )
    assert in_map == pytest.approx((east, north), abs=1e-9)
    assert speed.x >= 0 and speed.y == speed.z == 0


def test_a_drone_that_stands_faces_east():
    message = poses.odometry(HEAD, "drone0/base_link", (0.0, 0.0, 0.0), (0.0, 0.0))
    turn = message.pose.pose.orientation
    assert (turn.x, turn.y, turn.z, turn.w) == (0, 0, 0, 1)


def test_a_drone_that_flies_north_faces_north():
    assert poses.yaw_of((0.0, 10.0)) == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("prefix", "frame_id"), [("", "drone3/base_link"), ("a/", "a/drone3/base_link")]
)
def test_the_body_frame_of_a_drone_has_its_name(prefix, frame_id):
    assert poses.base_link("drone3", prefix) == frame_id


@given(TRACKS)
def test_a_path_and_a_pose_array_go_through_the_positions_in_order(positions):
    track, fleet = poses.path(HEAD, positions), poses.pose_array(HEAD, positions)
    assert [xyz(stamped.pose.position) for stamped in track.poses] == positions
    assert [xyz(pose.position) for pose in fleet.poses] == positions
    assert all(message.header == HEAD for message in (track, fleet, *track.poses))


@pytest.mark.slow
@given(TRACKS, TRACKS, SPEEDS, SPEEDS)
def test_a_message_filled_again_equals_a_new_one(positions, others, east, north):
    old, new = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)
    filled = poses.pose_stamped(HEAD, old)
    assert poses.pose_stamped(LATER_HEAD, new, into=filled) is filled
    assert filled == poses.pose_stamped(LATER_HEAD, new)

    fleet = poses.pose_array(HEAD, positions)
    again = poses.pose_array(LATER_HEAD, others, into=fleet)
    assert again is fleet and fleet == poses.pose_array(LATER_HEAD, others)

    track = poses.path(HEAD, positions)
    assert poses.path(LATER_HEAD, others, into=track) is track
    assert track == poses.path(LATER_HEAD, others)

    odometry = poses.odometry(HEAD, "drone0/base_link", old, (east, north))
    poses.odometry(LATER_HEAD, "drone0/base_link", new, (north, 0.0), into=odometry)
    fresh = poses.odometry(LATER_HEAD, "drone0/base_link", new, (north, 0.0))
    # Covariances are arrays, which message equality compares by element.
    assert (odometry.header, odometry.pose.pose) == (fresh.header, fresh.pose.pose)
    assert odometry.twist.twist == fresh.twist.twist


def test_a_fix_is_exact_and_says_so():
    message = poses.nav_sat_fix(HEAD, (np.float64(-24.03), np.float32(-46.0), 120))
    assert (message.latitude, message.longitude, message.altitude) == (-24.03, -46.0, 120.0)
    assert message.header == HEAD
    assert message.status.status == NavSatStatus.STATUS_FIX
    assert message.status.service == NavSatStatus.SERVICE_GPS
    assert message.position_covariance_type == NavSatFix.COVARIANCE_TYPE_KNOWN
    assert list(message.position_covariance) == [0.0] * 9
    again = poses.nav_sat_fix(LATER_HEAD, (1.0, 2.0, 3.0), into=message)
    assert again is message and message.latitude == 1.0 and message.header.stamp == LATER


@given(TRACKS)
def test_transforms_place_each_drones_body_where_its_pose_is(positions):
    bodies = [f"drone{number}/base_link" for number in range(len(positions))]
    yaws = [0.1 * number for number in range(len(positions))]
    transforms = poses.transforms(HEAD, bodies, positions, yaws)
    assert [xyz(transform.transform.translation) for transform in transforms] == positions
    assert [transform.child_frame_id for transform in transforms] == bodies
    for transform, yaw in zip(transforms, yaws, strict=True):
        assert transform.header == HEAD
        rotation = transform.transform.rotation
        assert 2 * math.atan2(rotation.z, rotation.w) == pytest.approx(yaw)


def test_transforms_of_the_wrong_number_are_refused():
    with pytest.raises(ValueError, match="zip"):
        poses.transforms(HEAD, ["drone0/base_link"], [(0.0, 0.0, 0.0)] * 2, [0.0, 0.0])


def test_the_earth_is_above_the_map():
    message = poses.earth_transform(STAMP, "sea", (1.0, 2.0, 3.0), (0.5, 0.5, 0.5, 0.5))
    assert (message.header.frame_id, message.child_frame_id) == ("earth", "sea")
    assert xyz(message.transform.translation) == (1.0, 2.0, 3.0)
    assert message.transform.rotation.w == 0.5 and message.header.stamp == STAMP

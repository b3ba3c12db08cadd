# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drones as poses, odometry, tracks and fixes."""

import math

import numpy as np
import pytest
from grid_frames import FRAMES
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import NavSatFix, NavSatStatus

from dsse_ros.result import Accepted
from dsse_ros.scenario.frames import GridFrame, cell_to_map
from msg_adapters import poses
from msg_adapters.commands import parse_goal
from msg_adapters.stamps import to_stamp

STAMP, LATER = to_stamp(13 * 10**9), to_stamp(26 * 10**9)
SPEEDS = st.floats(-40, 40).filter(lambda speed: speed == 0 or abs(speed) > 1e-6)
CELLS = st.lists(st.tuples(st.integers(0, 399), st.integers(0, 399)), max_size=8)


def xyz(position):
    return position.x, position.y, position.z


def place(frame, cell):
    return (*cell_to_map(frame, *cell), frame.alt_m)


@given(FRAMES, st.data())
def test_a_cell_comes_back_from_its_pose(frame, data):
    inside = st.integers(0, frame.grid_size - 1)
    cell = (data.draw(inside), data.draw(inside))
    message = poses.pose_stamped(frame, np.array(cell), STAMP)
    assert message.header.frame_id == frame.map_frame and message.header.stamp == STAMP
    assert xyz(message.pose.position) == place(frame, cell)
    assert parse_goal(message, frame) == Accepted(cell)


@given(FRAMES, st.floats(0, 300), st.floats(0, 300), SPEEDS, SPEEDS)
def test_odometry_turned_back_into_the_map_frame_is_the_velocity(frame, col, row, east, north):
    message = poses.odometry(frame, "drone3", col, row, (east, north), STAMP)
    assert (message.header.frame_id, message.child_frame_id) == (
        frame.map_frame,
        f"{frame.frame_prefix}drone3/base_link",
    )
    assert xyz(message.pose.pose.position) == pytest.approx(place(frame, (col, row)))
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
    turn = poses.odometry(
        GridFrame(8, 130.0, 0.0, 0.0, 0.0, 0.0), "drone0", 0, 0, (0.0, 0.0), STAMP
    ).pose.pose.orientation
    assert (turn.x, turn.y, turn.z, turn.w) == (0, 0, 0, 1)


def test_a_drone_that_flies_north_faces_north():
    assert poses.yaw_of((0.0, 10.0)) == pytest.approx(math.pi / 2)


@pytest.mark.slow
@given(FRAMES, CELLS)
def test_a_path_and_a_pose_array_go_through_the_cells_in_order(frame, cells):
    track = poses.path(frame, np.array(cells).reshape(-1, 2), STAMP)
    fleet = poses.pose_array(frame, cells, STAMP)
    expected = [place(frame, cell) for cell in cells]
    assert [xyz(stamped.pose.position) for stamped in track.poses] == expected
    assert [xyz(pose.position) for pose in fleet.poses] == expected
    for message in (track, fleet, *track.poses):
        assert message.header.frame_id == frame.map_frame and message.header.stamp == STAMP


@pytest.mark.slow
@given(FRAMES, CELLS, CELLS, SPEEDS, SPEEDS)
def test_a_message_filled_again_equals_a_new_one(frame, cells, others, east, north):
    old, new = (1, 2), (3, 0)
    filled = poses.pose_stamped(frame, old, STAMP)
    assert poses.pose_stamped(frame, new, LATER, into=filled) is filled
    assert filled == poses.pose_stamped(frame, new, LATER)

    fleet = poses.pose_array(frame, cells, STAMP)
    again = poses.pose_array(frame, others, LATER, into=fleet)
    assert again is fleet and fleet == poses.pose_array(frame, others, LATER)

    track = poses.path(frame, cells, STAMP)
    assert poses.path(frame, others, LATER, into=track) is track
    assert track == poses.path(frame, others, LATER)

    odometry = poses.odometry(frame, "drone0", *old, (east, north), STAMP)
    poses.odometry(frame, "drone0", *new, (north, 0.0), LATER, into=odometry)
    fresh = poses.odometry(frame, "drone0", *new, (north, 0.0), LATER)
    # Covariances are arrays, which message equality compares by element.
    assert (odometry.header, odometry.pose.pose) == (fresh.header, fresh.pose.pose)
    assert odometry.twist.twist == fresh.twist.twist


def test_a_fix_is_exact_and_says_so():
    frame = GridFrame(8, 130.0, -24.04, -46.17, 0.0, 120.0)
    message = poses.nav_sat_fix(frame, np.float64(-24.03), np.float32(-46.0), 120, STAMP, "drone12")
    assert (message.latitude, message.longitude, message.altitude) == (-24.03, -46.0, 120.0)
    assert (
        message.header.frame_id == f"{frame.frame_prefix}drone12/base_link"
        and message.header.stamp == STAMP
    )
    assert message.status.status == NavSatStatus.STATUS_FIX
    assert message.status.service == NavSatStatus.SERVICE_GPS
    assert message.position_covariance_type == NavSatFix.COVARIANCE_TYPE_KNOWN
    assert list(message.position_covariance) == [0.0] * 9
    again = poses.nav_sat_fix(frame, 1.0, 2.0, 3.0, LATER, "drone12", into=message)
    assert again is message and message.latitude == 1.0 and message.header.stamp == LATER


@given(FRAMES, CELLS)
def test_transforms_place_each_drones_body_where_its_pose_is(frame, cells):
    names = [f"drone{number}" for number in range(len(cells))]
    yaws = [0.1 * number for number in range(len(cells))]
    for made, cell, name, yaw in zip(
        poses.transforms(frame, cells, names, STAMP, yaws), cells, names, yaws, strict=True
    ):
        child = f"{frame.frame_prefix}{name}/base_link"
        assert (made.header.frame_id, made.child_frame_id) == (frame.map_frame, child)
        assert xyz(made.transform.translation) == place(frame, cell)
        rotation = made.transform.rotation
        assert 2 * math.atan2(rotation.z, rotation.w) == pytest.approx(yaw)


def test_transforms_of_the_wrong_number_are_refused():
    frame = GridFrame(8, 130.0, 0.0, 0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="zip"):
        poses.transforms(frame, [(0, 0), (1, 1)], ["drone0"], STAMP)

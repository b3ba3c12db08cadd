# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drones as poses, odometry, paths, fixes and transforms in the map frame.

Functions with `into` fill and return that message, one of their own earlier results, instead of
a new one: building messages costs as much as publishing them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, PoseArray, PoseStamped, Quaternion, TransformStamped
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import NavSatFix, NavSatStatus
from std_msgs.msg import Header

Position = tuple[float, float, float]
"""x east, y north and z up in metres in the map frame."""


class FramedPose(NamedTuple):
    """A pose that somebody sent, in a frame that may be any.

    Attributes:
        frame_id: Name of the frame.
        position: x, y, z in metres.
        orientation: Quaternion x, y, z, w.
    """

    frame_id: str
    position: Position
    orientation: tuple[float, float, float, float]


def pose_from_message(message: PoseStamped) -> FramedPose:
    """Return the pose of a message, whatever its numbers are."""
    position, turn = message.pose.position, message.pose.orientation
    return FramedPose(
        message.header.frame_id,
        (position.x, position.y, position.z),
        (turn.x, turn.y, turn.z, turn.w),
    )


def poses_from_message(message: Path) -> list[FramedPose]:
    """Return the poses of a track; one without a frame of its own is in that of the track."""
    poses = [pose_from_message(stamped) for stamped in message.poses]
    return [
        pose if pose.frame_id else pose._replace(frame_id=message.header.frame_id) for pose in poses
    ]


def base_link(drone_name: str, frame_prefix: str = "") -> str:
    """Return the name of a drone's body frame (REP-105): x forward, y left, z up."""
    return f"{frame_prefix}{drone_name}/base_link"


def yaw_of(velocity_mps: tuple[float, float]) -> float:
    """Return the heading of a drone in radians from east to north; 0 for one that stands.

    Args:
        velocity_mps: Velocity (east, north).
    """
    east, north = velocity_mps
    return math.atan2(north, east) if east or north else 0.0


def pose_stamped(
    header: Header, position: Position, yaw_rad: float = 0.0, into: PoseStamped | None = None
) -> PoseStamped:
    """Return the pose of a drone.

    Args:
        header: Time of the pose, and the map frame.
        position: Where the drone is.
        yaw_rad: Where it points, from east to north.
        into: Message to fill.
    """
    message = PoseStamped() if into is None else into
    message.header = header
    _set_position(message.pose, position)
    _turn(message.pose.orientation, yaw_rad)
    return message


def odometry(
    header: Header,
    child_frame_id: str,
    position: Position,
    velocity_mps: tuple[float, float],
    yaw_rad: float | None = None,
    into: Odometry | None = None,
) -> Odometry:
    """Return where a drone is and how fast it flies.

    The pose is in the map frame, the twist in the child frame as nav_msgs/Odometry has it. A drone
    that points along its velocity has its whole speed along x.

    Args:
        header: Time of the state, and the map frame.
        child_frame_id: Body frame of the drone.
        position: Where it is.
        velocity_mps: Velocity over the ground (east, north).
        yaw_rad: Where it points, from east to north; None for along the velocity.
        into: Message to fill.
    """
    message = Odometry() if into is None else into
    east, north = velocity_mps
    ahead, left = math.hypot(east, north), 0.0
    if yaw_rad is None:
        yaw_rad = yaw_of(velocity_mps)
    else:
        sin, cos = math.sin(yaw_rad), math.cos(yaw_rad)
        ahead, left = east * cos + north * sin, north * cos - east * sin
    message.header = header
    message.child_frame_id = child_frame_id
    _set_position(message.pose.pose, position)
    _turn(message.pose.pose.orientation, yaw_rad)
    message.twist.twist.linear.x, message.twist.twist.linear.y = ahead, left
    return message


def path(header: Header, positions: Sequence[Position], into: Path | None = None) -> Path:
    """Return a track.

    Args:
        header: Time of the message and of each of its poses, and the map frame.
        positions: The track.
        into: Message to fill.
    """
    message = Path() if into is None else into
    message.header = header
    poses = message.poses[: len(positions)]
    poses += [PoseStamped() for _ in positions[len(poses) :]]
    for stamped, position in zip(poses, positions, strict=True):
        stamped.header = header
        _set_position(stamped.pose, position)
    message.poses = poses
    return message


def pose_array(
    header: Header,
    positions: Sequence[Position],
    yaws_rad: Sequence[float] | None = None,
    into: PoseArray | None = None,
) -> PoseArray:
    """Return the poses of all drones, in the order of the agents.

    Args:
        header: Time of the poses, and the map frame.
        positions: Where the drones are.
        yaws_rad: Where they point, from east to north; None for all to the east.
        into: Message to fill.
    """
    message = PoseArray() if into is None else into
    message.header = header
    if len(message.poses) != len(positions):
        message.poses = [Pose() for _ in positions]
    for pose, position, yaw_rad in zip(
        message.poses, positions, yaws_rad or [0.0] * len(positions), strict=True
    ):
        _set_position(pose, position)
        _turn(pose.orientation, yaw_rad)
    return message


def nav_sat_fix(
    header: Header, fix: tuple[float, float, float], into: NavSatFix | None = None
) -> NavSatFix:
    """Return the WGS84 fix of a drone.

    The fix is exact, hence a known covariance of zero.

    Args:
        header: Time of the fix, and the body frame of the drone, where the antenna is.
        fix: Latitude and longitude in degrees, height above the WGS84 ellipsoid in metres.
        into: Message to fill.
    """
    message = NavSatFix() if into is None else into
    message.header = header
    message.status.status = NavSatStatus.STATUS_FIX
    message.status.service = NavSatStatus.SERVICE_GPS
    message.latitude, message.longitude, message.altitude = map(float, fix)
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_KNOWN
    return message


def transforms(
    header: Header,
    child_frame_ids: Sequence[str],
    positions: Sequence[Position],
    yaws_rad: Iterable[float],
) -> list[TransformStamped]:
    """Return the transforms from the map frame to the body frame of each of N drones.

    Args:
        header: Time of the transforms, and the map frame.
        child_frame_ids: The N body frames.
        positions: The N positions.
        yaws_rad: The N headings, as `yaw_of` gives them to `odometry`.

    Raises:
        ValueError: If the numbers of frames, positions and headings differ.
    """
    messages = []
    for child, position, yaw_rad in zip(child_frame_ids, positions, yaws_rad, strict=True):
        message = TransformStamped(header=header, child_frame_id=child)
        translation = message.transform.translation
        translation.x, translation.y, translation.z = position
        _turn(message.transform.rotation, yaw_rad)
        messages.append(message)
    return messages


def earth_transform(
    stamp: Time, map_frame: str, position: Position, turn: tuple[float, float, float, float]
) -> TransformStamped:
    """Return the transform from `earth` (REP-105), which all maps share, to the map frame.

    Args:
        stamp: Time of the transform.
        map_frame: Name of the map frame.
        position: Origin of the map frame in ECEF, in metres.
        turn: Its axes in ECEF as a quaternion x, y, z, w.
    """
    message = TransformStamped(header=Header(stamp=stamp, frame_id="earth"))
    message.child_frame_id = map_frame
    translation, rotation = message.transform.translation, message.transform.rotation
    translation.x, translation.y, translation.z = position
    rotation.x, rotation.y, rotation.z, rotation.w = turn
    return message


def _set_position(pose: Pose, position: Position) -> None:
    pose.position.x, pose.position.y, pose.position.z = position


def _turn(orientation: Quaternion, yaw_rad: float) -> None:
    orientation.z = math.sin(yaw_rad / 2)
    orientation.w = math.cos(yaw_rad / 2)

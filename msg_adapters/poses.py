# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drones as poses, odometry, paths, fixes and transforms in the map frame, at flight altitude.

Functions for a single drone take its own frame, see `GridFrame.of_drone`.

Functions with `into` fill and return that message, one of their own earlier results, instead of
a new one: building messages costs as much as publishing them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, PoseArray, PoseStamped, Quaternion, TransformStamped
from nav_msgs.msg import Odometry, Path
from numpy.typing import ArrayLike
from sensor_msgs.msg import NavSatFix, NavSatStatus

from dsse_ros.scenario.frames import GridFrame, cell_to_map
from dsse_ros.scenario.geodesy import map_in_earth


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
    frame: GridFrame, cell: Sequence[float], stamp: Time, into: PoseStamped | None = None
) -> PoseStamped:
    """Return the pose of a drone over a cell (col, row), facing east."""
    message = PoseStamped() if into is None else into
    _stamp(message, frame, stamp)
    _place(message.pose, frame, cell)
    return message


def odometry(
    frame: GridFrame,
    drone_name: str,
    col: float,
    row: float,
    velocity_mps: tuple[float, float],
    stamp: Time,
    into: Odometry | None = None,
) -> Odometry:
    """Return where a drone is and how fast it flies.

    The pose is in the map frame, turned along the velocity; the twist is in the child frame as
    nav_msgs/Odometry has it, so that a drone in motion has its whole speed along x.

    Args:
        frame: The grid.
        drone_name: Name of the drone.
        col: Column, a fraction lies between cells.
        row: Row.
        velocity_mps: Velocity (east, north).
        stamp: Time of the state.
        into: Message to fill.
    """
    message = Odometry() if into is None else into
    _stamp(message, frame, stamp)
    message.child_frame_id = base_link(drone_name, frame.frame_prefix)
    _place(message.pose.pose, frame, (col, row))
    _turn(message.pose.pose.orientation, yaw_of(velocity_mps))
    message.twist.twist.linear.x = math.hypot(*velocity_mps)
    return message


def path(frame: GridFrame, cells: ArrayLike, stamp: Time, into: Path | None = None) -> Path:
    """Return a track.

    Args:
        frame: The grid.
        cells: (K, 2) of (col, row).
        stamp: Time of the message and of each of its poses.
        into: Message to fill.
    """
    message = Path() if into is None else into
    _stamp(message, frame, stamp)
    positions = _positions(frame, cells, frame.alt_m)
    poses = message.poses[: len(positions)]
    poses += [PoseStamped(header=message.header) for _ in positions[len(poses) :]]
    for stamped, position in zip(poses, positions, strict=True):
        _set_position(stamped.pose, position)
    message.poses = poses
    return message


def pose_array(
    frame: GridFrame, cells: ArrayLike, stamp: Time, into: PoseArray | None = None
) -> PoseArray:
    """Return the poses of all drones.

    Args:
        frame: The grid.
        cells: (N, 2) of (col, row), in the order of the agents.
        stamp: Time of the poses.
        into: Message to fill.
    """
    message = PoseArray() if into is None else into
    _stamp(message, frame, stamp)
    positions = _positions(frame, cells)
    if len(message.poses) != len(positions):
        message.poses = [Pose() for _ in positions]
    for pose, position in zip(message.poses, positions, strict=True):
        _set_position(pose, position)
    return message


def nav_sat_fix(
    frame: GridFrame,
    lat_deg: float,
    lon_deg: float,
    alt_m: float,
    stamp: Time,
    drone_name: str,
    into: NavSatFix | None = None,
) -> NavSatFix:
    """Return the WGS84 fix of a drone.

    The fix is exact, hence a known covariance of zero.

    Args:
        frame: The grid, whose prefix the body frame has.
        lat_deg: Latitude.
        lon_deg: Longitude.
        alt_m: Height above the WGS84 ellipsoid.
        stamp: Time of the fix.
        drone_name: Name of the drone, whose body frame the antenna is at.
        into: Message to fill.
    """
    message = NavSatFix() if into is None else into
    message.header.stamp = stamp
    message.header.frame_id = base_link(drone_name, frame.frame_prefix)
    message.status.status = NavSatStatus.STATUS_FIX
    message.status.service = NavSatStatus.SERVICE_GPS
    message.latitude = float(lat_deg)
    message.longitude = float(lon_deg)
    message.altitude = float(alt_m)
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_KNOWN
    return message


def transforms(
    frame: GridFrame,
    cells: ArrayLike,
    names: Sequence[str],
    stamp: Time,
    yaws_rad: Sequence[float] | None = None,
) -> list[TransformStamped]:
    """Return the transforms from the map frame to the body frame of each drone.

    Args:
        frame: The grid.
        cells: (N, 2) of (col, row), fractions lie between cells.
        names: The N names.
        stamp: Time of the transforms.
        yaws_rad: The N headings, as `yaw_of` gives them to `odometry`; east if not given.

    Raises:
        ValueError: If the numbers of cells, names and headings differ.
    """
    positions = _positions(frame, cells)
    messages = []
    yaws = [0.0] * len(positions) if yaws_rad is None else yaws_rad
    for position, name, yaw in zip(positions, names, yaws, strict=True):
        message = TransformStamped()
        _stamp(message, frame, stamp)
        message.child_frame_id = base_link(name, frame.frame_prefix)
        translation = message.transform.translation
        translation.x, translation.y, translation.z = position
        _turn(message.transform.rotation, yaw)
        messages.append(message)
    return messages


def earth_transform(frame: GridFrame, stamp: Time) -> TransformStamped:
    """Return the transform from `earth` (REP-105), which all maps share, to the map frame."""
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id = "earth"
    message.child_frame_id = frame.map_frame
    position, turn = map_in_earth(frame)
    translation, rotation = message.transform.translation, message.transform.rotation
    translation.x, translation.y, translation.z = position
    rotation.x, rotation.y, rotation.z, rotation.w = turn
    return message


def _stamp(message: Any, frame: GridFrame, stamp: Time) -> None:
    message.header.stamp = stamp
    message.header.frame_id = frame.map_frame


def _positions(
    frame: GridFrame, cells: ArrayLike, alt_m: float | None = None
) -> list[tuple[float, float, float]]:
    """Return the places of all drones over their cells, or, at one altitude, of one drone."""
    array = np.asarray(cells, dtype=np.float64).reshape(-1, 2)
    x_m, y_m = cell_to_map(frame, array[:, 0], array[:, 1])
    alts_m = frame.altitudes_m(len(array)) if alt_m is None else [alt_m] * len(array)
    return list(zip(x_m.tolist(), y_m.tolist(), alts_m, strict=True))


def _place(pose: Pose, frame: GridFrame, cell: Sequence[float]) -> None:
    x_m, y_m = cell_to_map(frame, float(cell[0]), float(cell[1]))
    _set_position(pose, (x_m, y_m, frame.alt_m))


def _set_position(pose: Pose, position: tuple[float, float, float]) -> None:
    pose.position.x, pose.position.y, pose.position.z = position


def _turn(orientation: Quaternion, yaw_rad: float) -> None:
    orientation.z = math.sin(yaw_rad / 2)
    orientation.w = math.cos(yaw_rad / 2)

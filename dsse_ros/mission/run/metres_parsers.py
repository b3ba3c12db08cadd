# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commands of drones that fly in metres, and reported winds, `Accepted` or `Rejected`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.fields import shown
from dsse_ros.base.result import Accepted, Rejected, Result
from dsse_ros.mission.run.command_parsers import parse_point
from dsse_ros.search.environments.space import STRAIGHT_ON
from dsse_ros.search.step.metres_paths import shares_of
from dsse_ros.world.scenario.frames import GridFrame, flip_y

if TYPE_CHECKING:
    from msg_adapters.poses import FramedPose
    from msg_adapters.velocities import FramedTwist
    from msg_adapters.winds import FramedWind

Action = tuple[float, float]
"""A turn and a speed, -1 to 1, see `step.metres_paths`."""

MAX_POINTS = 10_000
"""Largest number of points of a track."""
_NO_ACTION = STRAIGHT_ON
"""In a joint command: the place of a drone that is not live."""


class Velocity(NamedTuple):
    """A commanded velocity in the body frame.

    Attributes:
        forward: Airspeed, m/s.
        yaw_rate: To the left, rad/s.
    """

    forward: float
    yaw_rate: float


def parse_joint_command(
    data: Sequence[float], mission: int, step: int, live: Sequence[bool]
) -> Result[tuple[Action, ...]]:
    """Return the actions of a `joint_command`, for all drones or for none.

    Args:
        data: The command, [mission, step, turn0, speed0, turn1, ...].
        mission: Number of the mission.
        step: Number of the step that the actions must be for: that of the last report.
        live: For each of the N drones whether it takes part; the others' entries are ignored.

    Returns:
        N actions, any where a drone is not live, or `wrong_size`, `stale_mission`, `stale_step`
        or `out_of_range`.
    """
    if len(data) != 2 + 2 * len(live):
        reason = (
            f"data must be mission, step and {len(live)} turns and speeds, got {len(data)} numbers"
        )
        return Rejected("wrong_size", reason)
    for code, name, expected, got in (
        ("stale_mission", "data[0] must be mission", mission, data[0]),
        ("stale_step", "data[1] must be step", step, data[1]),
    ):
        if got != expected:
            return Rejected(code, f"{name} {expected}, got {got:g}")
    chosen = []
    for drone, takes_part in enumerate(live):
        action = _NO_ACTION
        if takes_part:
            for index in (2 + 2 * drone, 3 + 2 * drone):
                # This form of the comparison also refuses NaN.
                if not abs(data[index]) <= 1.0:
                    reason = f"data[{index}] must be from -1 to 1, got {data[index]:g}"
                    return Rejected("out_of_range", reason)
            action = float(data[2 + 2 * drone]), float(data[3 + 2 * drone])
        chosen.append(action)
    return Accepted(tuple(chosen))


def parse_velocity(twist: FramedTwist, body_frame: str) -> Result[Velocity]:
    """Return the velocity of a `cmd_vel`.

    It is in the body frame of the drone (REP-103): x forward, y left, z up.

    Returns:
        The velocity, or `foreign_frame`, `not_finite` or `not_forward`.
    """
    if twist.frame_id not in ("", body_frame):
        reason = f"header.frame_id must be {body_frame!r} or empty, got {shown(twist.frame_id)}"
        return Rejected("foreign_frame", reason)
    for part in ("linear", "angular"):
        for axis, value in zip("xyz", getattr(twist, part), strict=True):
            if not math.isfinite(value):
                reason = f"twist.{part}.{axis} must be a finite number, got {value!r}"
                return Rejected("not_finite", reason)
            if value and (part, axis) not in (("linear", "x"), ("angular", "z")):
                reason = f"twist.{part}.{axis} must be 0: drones fly forward, got {value:g}"
                return Rejected("not_forward", reason)
    return Accepted(Velocity(twist.linear[0], twist.angular[2]))


def action_of(velocity: Velocity, airframe: np.record, step_s: float) -> Action:
    """Return the action that flies a velocity for a step of step_s, as far as a drone can.

    Its airframe is one of `metres_paths.AIRFRAMES`.
    """
    speed = min(max(velocity.forward, float(airframe.slowest)), float(airframe.cruise))
    return shares_of(airframe, -velocity.yaw_rate * step_s, speed, step_s)


def parse_track(poses: Sequence[FramedPose], frame: GridFrame) -> Result[NDArray[np.float64]]:
    """Return the points (M, 2) of a `command_path`, or of one `command_pose`.

    Altitudes and headings are not used, but must be finite.

    Returns:
        Metres to the east and to the south of the grid's north-west corner, or `wrong_size`,
        `foreign_frame`, `not_finite` or `outside_grid`.
    """
    if not 1 <= len(poses) <= MAX_POINTS:
        return Rejected("wrong_size", f"poses must be 1 to {MAX_POINTS}, got {len(poses)}")
    points = []
    for number, pose in enumerate(poses):
        parsed = parse_point(pose, frame)
        if isinstance(parsed, Rejected):
            where = f"poses[{number}]: " if len(poses) > 1 else ""
            return Rejected(parsed.code, f"{where}{parsed.reason}")
        x_m, y_m = parsed.value
        points.append((x_m, flip_y(frame.extent.height, y_m)))
    return Accepted(np.array(points))


def parse_wind(wind: FramedWind, frame: GridFrame) -> Result[tuple[float, float]]:
    """Return the wind of a `vehicle_wind`.

    Its part upwards is not used, but must be finite.

    Returns:
        Its velocity to the east and to the north, m/s, or `foreign_frame` or `not_finite`.
    """
    if wind.frame_id not in ("", frame.map_frame):
        reason = f"header.frame_id must be {frame.map_frame!r} or empty, got {shown(wind.frame_id)}"
        return Rejected("foreign_frame", reason)
    for axis, value in zip("xyz", wind.velocity, strict=True):
        if not math.isfinite(value):
            return Rejected("not_finite", f"vector.{axis} must be a finite number, got {value!r}")
    east, north, _ = wind.velocity
    return Accepted((east, north))

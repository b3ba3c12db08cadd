# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Commanded velocities in a body frame."""

from __future__ import annotations

from typing import NamedTuple

from geometry_msgs.msg import TwistStamped

Vector = tuple[float, float, float]


class FramedTwist(NamedTuple):
    """A velocity that somebody sent, in a frame that may be any.

    Attributes:
        frame_id: Name of the frame.
        linear: x, y, z in m/s.
        angular: About x, y, z in rad/s.
    """

    frame_id: str
    linear: Vector
    angular: Vector


def twist_from_message(message: TwistStamped) -> FramedTwist:
    """Return the velocity of a message, whatever its numbers are."""
    linear, angular = message.twist.linear, message.twist.angular
    return FramedTwist(
        message.header.frame_id,
        (linear.x, linear.y, linear.z),
        (angular.x, angular.y, angular.z),
    )

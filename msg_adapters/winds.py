# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The wind in which vehicles fly, in the map frame."""

from __future__ import annotations

from typing import NamedTuple

from geometry_msgs.msg import Vector3, Vector3Stamped
from std_msgs.msg import Header


class FramedWind(NamedTuple):
    """A wind that somebody sent, in a frame that may be any.

    Attributes:
        frame_id: Name of the frame.
        velocity: Of the air, x, y, z in m/s.
    """

    frame_id: str
    velocity: tuple[float, float, float]


def wind_message(header: Header, wind_mps: tuple[float, float]) -> Vector3Stamped:
    """Return the message of a wind.

    Args:
        header: Time of the report, and the map frame.
        wind_mps: Velocity of the air to the east and to the north, m/s.
    """
    east, north = wind_mps
    return Vector3Stamped(header=header, vector=Vector3(x=float(east), y=float(north), z=0.0))


def wind_from_message(message: Vector3Stamped) -> FramedWind:
    """Return the wind of a message, whatever its numbers are."""
    vector = message.vector
    return FramedWind(message.header.frame_id, (vector.x, vector.y, vector.z))

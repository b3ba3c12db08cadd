# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The particles of a belief as sensor_msgs/PointCloud2."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from msg_adapters.point_clouds import cloud_message

PARTICLE = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("weight", "<f4")])
"""A particle: metres in the map frame, at sea level, and its share of the probability."""


def particles_message(
    header: Header,
    positions: NDArray[np.float32],
    weights: NDArray[np.float64],
    into: PointCloud2 | None = None,
) -> PointCloud2:
    """Return the particles as a cloud of height 1.

    Args:
        header: Time of the positions, and the map frame.
        positions: (M, 2), metres to the east and to the north.
        weights: (M,), they sum to 1.
        into: See `cloud_message`.
    """
    points = np.zeros((1, len(weights)), PARTICLE)
    points["x"][0], points["y"][0] = positions.T
    points["weight"][0] = weights
    message = cloud_message(header, points, into)
    # A particle that is nowhere has no finite position.
    message.is_dense = bool(np.isfinite(positions).all())
    return message

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tasks of the vehicles: a NumPy structured array to sensor_msgs/PointCloud2 and back.

One entry per drone; x, y, z are float32 metres in the map frame, so that RViz shows where the
vehicles go.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from msg_adapters.point_clouds import cloud_message, points_from_message

VEHICLE_TASK = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("run_id", "<u4"),
        ("mission", "<u4"),
        ("task", "<u4"),  # number of the task in this run, from 1
        ("col", "<i2"),  # cell where the task ends
        ("row", "<i2"),
        ("action", "i1"),  # action of the drone, -1 to stay there
    ]
)
"""The task of one drone's vehicle, packed."""


def vehicle_tasks_message(header: Header, tasks: NDArray[Any]) -> PointCloud2:
    """Return tasks (N,) of `VEHICLE_TASK` as a cloud of one row.

    Args:
        header: Time of the last step, and the map frame.
        tasks: The tasks in the order of the agents.
    """
    return cloud_message(header, tasks[np.newaxis])


def vehicle_tasks_from_message(message: PointCloud2) -> NDArray[Any]:
    """Return the tasks in a cloud: the inverse of `vehicle_tasks_message`.

    Raises:
        ValueError: If the cloud has no tasks.
    """
    if message.height != 1:
        raise ValueError(f"height must be 1, got {message.height}")
    tasks: NDArray[Any] = points_from_message(message, VEHICLE_TASK)[0]
    return tasks

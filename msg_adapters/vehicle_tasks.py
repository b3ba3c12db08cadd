# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The tasks of the vehicles: a NumPy structured array to sensor_msgs/PointCloud2 and back.

One column per drone; x, y, z are float32 metres in the map frame, so that RViz shows where the
vehicles go. In metres the rows are the points of their ways, to be flown at equal times of a step;
elsewhere there is one row, where the tasks end.
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
"""A point of the task of one drone's vehicle, packed."""

MAX_POINTS = 64
"""Largest number of points of a way."""


def vehicle_tasks_message(header: Header, tasks: NDArray[Any]) -> PointCloud2:
    """Return tasks (P, N) of `VEHICLE_TASK` as a cloud of P rows.

    Args:
        header: Time of the last step, and the map frame.
        tasks: The tasks in the order of the agents.
    """
    return cloud_message(header, tasks)


def vehicle_tasks_from_message(message: PointCloud2) -> NDArray[Any]:
    """Return the tasks (P, N) in a cloud: the inverse of `vehicle_tasks_message`.

    Raises:
        ValueError: If the cloud has no tasks.
    """
    if not 1 <= message.height <= MAX_POINTS:
        raise ValueError(f"height must be 1 to {MAX_POINTS}, got {message.height}")
    tasks = points_from_message(message, VEHICLE_TASK)
    if len({*map(bytes, tasks["task"])}) > 1:
        raise ValueError("task must be the same in all rows")
    return tasks

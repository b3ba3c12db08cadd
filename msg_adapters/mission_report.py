# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The report of a whole mission: a NumPy structured array to sensor_msgs/PointCloud2 and back.

One row per step, one entry per drone, for nodes that joined late or missed step reports.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from msg_adapters.point_clouds import cloud_message, points_from_message
from msg_adapters.step_report import POINT

MISSION_REPORT_DTYPE = np.dtype([*POINT])
"""Layout of an entry: that of a step report up to `held`."""


def mission_report_message(header: Header, report: NDArray[Any]) -> PointCloud2:
    """Return a report as a cloud with a row per step and a column per drone.

    Args:
        header: Time of the last step, and the map frame.
        report: (K, N) of `MISSION_REPORT_DTYPE`.

    Raises:
        ValueError: If the array is not a report.
    """
    if report.dtype != MISSION_REPORT_DTYPE or report.ndim != 2:
        raise ValueError(
            "report must be (K, N) of MISSION_REPORT_DTYPE, "
            f"got {report.shape} of {report.dtype!r:.60}"
        )
    return cloud_message(header, report)


def mission_report_from_message(message: PointCloud2) -> NDArray[Any]:
    """Return the report (K, N) in a cloud: the inverse of `mission_report_message`.

    Raises:
        ValueError: If the cloud is not a report.
    """
    return points_from_message(message, MISSION_REPORT_DTYPE)

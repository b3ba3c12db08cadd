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

from dsse_ros.scenario.frames import GridFrame, cell_to_map
from msg_adapters.point_clouds import cloud_message, points_from_message
from msg_adapters.step_report import POINT

MISSION_REPORT_DTYPE = np.dtype([*POINT])
"""Layout of an entry: that of a step report without the action mask."""


def make_mission_report(
    frame: GridFrame, *, run_id: int, mission: int, history: NDArray[Any]
) -> NDArray[Any]:
    """Return the report of a mission.

    Args:
        frame: The grid.
        run_id: Identity of the simulation since its start.
        mission: Number of the mission.
        history: (K, N) structured array with col, row, action, reward and the flags of the step
            report; row k is step k, row 0 the start.

    Returns:
        (K, N) of `MISSION_REPORT_DTYPE`.
    """
    report = np.zeros(history.shape, dtype=MISSION_REPORT_DTYPE)
    for name in history.dtype.names or ():
        report[name] = history[name]
    report["x"], report["y"] = cell_to_map(
        frame, history["col"].astype(np.float64), history["row"].astype(np.float64)
    )
    report["z"] = frame.altitudes_m(history.shape[1])
    report["run_id"], report["mission"] = run_id, mission
    report["step"] = np.arange(len(history))[:, np.newaxis]
    return report


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

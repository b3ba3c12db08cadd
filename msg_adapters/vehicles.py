# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The state of a vehicle as messages, and the parts that the simulation reads."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import NavSatFix, TimeReference
from std_msgs.msg import Header

from msg_adapters.diagnostics import Level, diagnostic_array, diagnostic_status
from msg_adapters.poses import Position, nav_sat_fix, pose_stamped
from msg_adapters.stamps import to_stamp

LOST = "lost"
TASK = "task"
LOOKED = "looked_task"
ARRIVED = "arrived_task"
BATTERY = "battery"
RUN_ID = "run_id"


@dataclass(frozen=True)
class Progress:
    """Progress of a vehicle with the tasks of its drone.

    Attributes:
        task: Number of the task that it follows; -1 if there is none. Without `vehicle_tasks`, the
            stamp of the step report that it follows, in nanoseconds.
        looked_task: Number of the task for which it has looked; -1 if there is none. A move looks
            when it has arrived.
        arrived_task: Number of the task of which it has done everything; -1 if there is none.
        lost: Why it does not follow its drone any more; empty if it does.
        battery: What is left in its battery, 1 when full; NaN if it is not known.
        run_id: Run of that task; 0 if it is not known.
    """

    task: int = -1
    looked_task: int = -1
    arrived_task: int = -1
    lost: str = ""
    battery: float = math.nan
    run_id: int = 0


def vehicle_pose(
    header: Header, position: Position, attitude: tuple[float, float, float]
) -> PoseStamped:
    """Return where a vehicle is in the map frame.

    Args:
        header: Time of the pose, and the map frame.
        position: Where it is.
        attitude: Roll, right side down, and pitch, nose up, in radians; and where its nose points,
            clockwise from north in degrees, NaN for east.
    """
    message = pose_stamped(header, position)
    roll, pitch, heading_deg = attitude
    yaw = math.radians(90.0 - heading_deg) if math.isfinite(heading_deg) else 0.0
    # In the frames of ROS the nose goes down with a positive pitch (REP-103).
    (sr, cr), (sp, cp), (sy, cy) = (
        (math.sin(angle / 2), math.cos(angle / 2)) for angle in (roll, -pitch, yaw)
    )
    turn = message.pose.orientation
    turn.x, turn.y = sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy
    turn.z, turn.w = cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy
    return message


def vehicle_fix(header: Header, fix: tuple[float, float, float]) -> NavSatFix:
    """Return where a vehicle is on the Earth; how exactly is not known.

    Args:
        header: Time of the fix, and the body frame of the vehicle's drone.
        fix: Latitude and longitude in degrees, height above the WGS84 ellipsoid in metres, NaN if
            it is not known.
    """
    message = nav_sat_fix(header, fix)
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_UNKNOWN
    return message


def vehicle_time(header: Header, vehicle: str, boot_s: float) -> TimeReference:
    """Return the clock of a vehicle.

    Args:
        header: Time of the reading, and the body frame of the vehicle's drone.
        vehicle: Which vehicle it is.
        boot_s: Time since its autopilot was started, s, by the autopilot's clock.
    """
    return TimeReference(
        header=header, time_ref=to_stamp(round(boot_s * 1e3) * 10**6), source=vehicle
    )


def vehicle_state_message(
    drone_name: str,
    hardware_id: str,
    stamp: Time,
    progress: Progress,
    *,
    level: Level,
    message: str,
    values: Mapping[str, object],
) -> DiagnosticArray:
    """Return the state of a vehicle.

    Args:
        drone_name: Name of the drone.
        hardware_id: Which vehicle it is.
        stamp: Time of the state.
        progress: How far it has come.
        level: Level of the state.
        message: One line for people.
        values: Whatever else is known.
    """
    own = {
        TASK: progress.task,
        LOOKED: progress.looked_task,
        ARRIVED: progress.arrived_task,
        LOST: progress.lost,
        BATTERY: f"{progress.battery:.2f}",
        RUN_ID: progress.run_id,
    }
    status = diagnostic_status(drone_name, level, message, {**own, **values}, hardware_id)
    return diagnostic_array(stamp, status)


def progress_from_message(message: DiagnosticArray, drone_name: str) -> Progress:
    """Return how far a vehicle has come: what `vehicle_state_message` says of it.

    Raises:
        ValueError: If the message does not say it.
    """
    for status in message.status:
        if status.name != drone_name:
            continue
        values = {pair.key: pair.value for pair in status.values}
        task, looked, arrived = (_integer(values.get(key, "")) for key in (TASK, LOOKED, ARRIVED))
        if task is None or looked is None or arrived is None or LOST not in values:
            needed = f"{TASK}, {LOOKED} and {ARRIVED} as integers, and {LOST}"
            raise ValueError(f"values must be {needed}, got {values!r:.60}")
        battery = _share(values.get(BATTERY, ""))
        run_id = _integer(values.get(RUN_ID, "")) or 0
        return Progress(task, looked, arrived, values[LOST], battery, run_id)
    raise ValueError(f"status: none is named {drone_name!r}")


def _share(text: str) -> float:
    """Return a number from 0 to 1, NaN for any other text."""
    try:
        share = float(text[:20])
    except ValueError:
        return math.nan
    return share if 0.0 <= share <= 1.0 else math.nan


def _integer(text: str) -> int | None:
    """Return the number; int() would take more than digits, and longer ones than it prints."""
    if len(text) <= 20 and text.removeprefix("-").isascii() and text.removeprefix("-").isdigit():
        return int(text)
    return None

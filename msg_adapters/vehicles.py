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
from sensor_msgs.msg import NavSatFix

from dsse_ros.result import Accepted, Rejected, Result, shown
from dsse_ros.scenario.frames import GridFrame
from dsse_ros.scenario.geodesy import geodetic_to_map
from msg_adapters.diagnostics import Level, diagnostic_array, diagnostic_status
from msg_adapters.poses import nav_sat_fix
from msg_adapters.stamps import header

LOST = "lost"
REPORT = "report_stamp_ns"
ARRIVED = "arrived_stamp_ns"
BATTERY = "battery"
RUN_ID = "run_id"


@dataclass(frozen=True)
class Progress:
    """Progress of a vehicle with its drone's steps.

    Attributes:
        report_stamp_ns: Stamp of the step report that it follows; -1 if there is none.
        arrived_stamp_ns: Stamp of the last step report of which it has done everything; -1 if
            there is none.
        lost: Why it does not follow its drone any more; empty if it does.
        battery: What is left in its battery, 1 when full; NaN if it is not known.
        run_id: Run of that step report; 0 if it is not known.
    """

    report_stamp_ns: int = -1
    arrived_stamp_ns: int = -1
    lost: str = ""
    battery: float = math.nan
    run_id: int = 0


def vehicle_pose(
    frame: GridFrame, lat_deg: float, lon_deg: float, alt_m: float, heading_deg: float, stamp: Time
) -> PoseStamped:
    """Return where a vehicle is in the map frame.

    Args:
        frame: The grid.
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_m: Height above the datum, which is as high as the grid's origin.
        heading_deg: Where its nose points, clockwise from north; NaN is east.
        stamp: Time of the pose.
    """
    x_m, y_m, z_m = geodetic_to_map(frame, lat_deg, lon_deg, frame.origin_alt_m + alt_m)
    message = PoseStamped(header=header(frame.map_frame, stamp))
    position, turn = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = x_m, y_m, z_m
    yaw_rad = math.radians(90.0 - heading_deg) if math.isfinite(heading_deg) else 0.0
    turn.z, turn.w = math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)
    return message


def vehicle_fix(
    frame: GridFrame,
    drone_name: str,
    lat_deg: float,
    lon_deg: float,
    alt_m: float,
    stamp: Time,
) -> NavSatFix:
    """Return where a vehicle is on the Earth; how exactly is not known.

    Args:
        frame: The grid.
        drone_name: Name of the drone.
        lat_deg: WGS84 latitude.
        lon_deg: WGS84 longitude.
        alt_m: Height above the WGS84 ellipsoid; NaN if it is not known.
        stamp: Time of the fix.
    """
    message = nav_sat_fix(frame, lat_deg, lon_deg, alt_m, stamp, drone_name)
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_UNKNOWN
    return message


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
        REPORT: progress.report_stamp_ns,
        ARRIVED: progress.arrived_stamp_ns,
        LOST: progress.lost,
        BATTERY: f"{progress.battery:.2f}",
        RUN_ID: progress.run_id,
    }
    status = diagnostic_status(drone_name, level, message, {**own, **values}, hardware_id)
    return diagnostic_array(stamp, status)


def progress_from_message(message: DiagnosticArray, drone_name: str) -> Result[Progress]:
    """Return how far a vehicle has come: what `vehicle_state_message` says of it.

    Returns:
        It, or `bad_state`.
    """
    for status in message.status:
        if status.name != drone_name:
            continue
        values = {pair.key: pair.value for pair in status.values}
        report_ns, arrived_ns = (_integer(values.get(key, "")) for key in (REPORT, ARRIVED))
        if report_ns is None or arrived_ns is None or LOST not in values:
            needed = f"{REPORT} and {ARRIVED} as integers, and {LOST}"
            return Rejected("bad_state", f"values must be {needed}, got {shown(values)}")
        battery = _share(values.get(BATTERY, ""))
        run_id = _integer(values.get(RUN_ID, "")) or 0
        return Accepted(Progress(report_ns, arrived_ns, values[LOST], battery, run_id))
    return Rejected("bad_state", f"status: none is named {drone_name!r}")


def place_from_pose(message: PoseStamped, frame: GridFrame) -> Result[tuple[float, float]]:
    """Return x and y in metres of a vehicle's pose in the map frame, on the grid or not.

    Returns:
        Them, or `foreign_frame` or `not_finite`.
    """
    if message.header.frame_id != frame.map_frame:
        return Rejected(
            "foreign_frame",
            f"header.frame_id must be {frame.map_frame!r}, got {shown(message.header.frame_id)}",
        )
    x_m, y_m = message.pose.position.x, message.pose.position.y
    if not (math.isfinite(x_m) and math.isfinite(y_m)):
        return Rejected("not_finite", f"pose.position must be finite, got ({x_m!r}, {y_m!r})")
    return Accepted((x_m, y_m))


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

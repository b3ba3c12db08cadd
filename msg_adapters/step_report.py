# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The step report: a NumPy structured array to sensor_msgs/PointCloud2 and back.

One entry per drone; x, y, z are float32 metres in the map frame, so that RViz shows the cloud.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from msg_adapters.point_clouds import cloud_message, points_from_message

MAX_ACTIONS = 127
"""Action numbers are int8."""

MAX_PATH_POINTS = 64

MAX_STATUS = 6
"""Largest number of a drone's status."""

FLAGS = ("terminated", "truncated", "found", "held")

POINT = (
    ("x", "<f4"),
    ("y", "<f4"),
    ("z", "<f4"),
    ("step", "<u4"),
    ("run_id", "<u4"),
    ("mission", "<u4"),
    ("reward", "<f8"),
    ("col", "<i2"),
    ("row", "<i2"),
    ("action", "i1"),
    *((flag, "u1") for flag in FLAGS),
)
"""Fields of a drone in a step, in the reports of a step and of a mission."""

FIND_FIELDS = (("finds", "<u4", (2,)),)
"""Fields of a drone in a step of a mission with sensors that look at several cells at once.

A `PointField` has no 64 bits; those of the first 32 looks come first."""

COVERAGE_FIELDS = (("coverage_rate", "<f8"), ("repeated_coverage", "<f8"), ("pos", "<f8"))
"""Fields of a drone in a step of a coverage task, the same for all drones."""

FAULT_FIELDS = (("battery", "<f8"), ("status", "u1"), ("command", "i1"))
"""Fields of a drone in a step of a mission with faults."""

MAX_WORK = 2
"""Largest number of the work that a drone's vehicle still has to do."""

VEHICLE_FIELDS = (("work", "u1"), ("look_action", "i1"), ("look_col", "<i2"), ("look_row", "<i2"))
"""Fields of a drone in a step of a mission whose actions last as long as the vehicles need."""

FLIGHT_FIELDS = (("heading", "<f8"), ("airspeed", "<f8"), ("turn_action", "<f8"),
                 ("speed_action", "<f8"))  # fmt: skip
"""Fields of a drone in a step in metres; `path` follows."""

_PATH, _LOOKED = "path", "looked"
FLOWN_FIELDS = (("wind", "<f8", (2,)),)
"""Fields of a drone in a step in metres that vehicles have flown; `looked` comes before."""
_ALL_FOUND = "all_found"
_MASK = "action_mask"


@cache
def step_report_dtype(
    num_actions: int,
    *,
    coverage: bool = False,
    faults: bool = False,
    finds: bool = False,
    vehicles: bool = False,
    path_points: int = 0,
) -> np.dtype[Any]:
    """Return the layout of one drone's entry: packed, little-endian.

    Fields: x, y, z (m, map frame, float32), step (uint32), run_id and mission (uint32, as in
    `AgentsInfo`), reward (float64), col, row (int16), action (int8: the one applied, -1 if none),
    terminated, truncated, found, held, all_found (uint8: 0 or 1), action_mask (uint8 x num_actions:
    0 if the action would leave the grid). Where the task is coverage, coverage_rate,
    repeated_coverage and pos (float64) follow, the same for all drones. With faults further battery
    (float64, percent, NaN where it does not run down), status (uint8, number of the status, at most
    `MAX_STATUS`) and command (int8, the commanded action). With sensors that look at several cells
    at once finds (uint32 x 2, a bit for each look that found a person). With actions that last as
    long as the vehicles need, work (uint8, at most `MAX_WORK`): what the vehicle still had to do
    in the step, 0 nothing, 1 to come back after it had looked, 2 all of it; and look_action (int8),
    look_col and look_row (int16), the action whose looks it has done, -1 for none, and the cell
    from which; not in metres.

    In metres, where there are no actions by number, `path_points` is at least 2 and action_mask is
    missing: heading (float64, radians clockwise from north), airspeed (float64, m/s), turn_action
    and speed_action (float64, -1 to 1, those of the step) and path (float64 x 2 path_points,
    metres to the east and to the south of the grid's north-west corner, at equal times of the step
    up to the present) follow. If vehicles have flown it, looked (uint8 x path_points: whether the
    vehicle looked right before the path, and on each piece of it) and wind (float64 x 2: the wind
    after the step, to the east and to the north, m/s, the same for all drones).

    Raises:
        ValueError: If the number of actions is not 1 to `MAX_ACTIONS`, or 0 in metres.
    """
    if path_points:
        mask: tuple[tuple[Any, ...], ...] = ()
        if num_actions or not 2 <= path_points <= MAX_PATH_POINTS:
            raise ValueError(f"path must be 2 to {MAX_PATH_POINTS} points, got {path_points!r}")
    elif not 1 <= num_actions <= MAX_ACTIONS:
        raise ValueError(f"num_actions must be 1 to {MAX_ACTIONS}, got {num_actions!r}")
    else:
        mask = ((_MASK, "u1", (int(num_actions),)),)
    flight = (*FLIGHT_FIELDS, (_PATH, "<f8", (2 * path_points,))) if path_points else ()
    of_vehicles = (
        ((_LOOKED, "u1", (path_points,)), *FLOWN_FIELDS) if path_points else VEHICLE_FIELDS
    )
    further = (
        *(COVERAGE_FIELDS if coverage else ()),
        *(FAULT_FIELDS if faults else ()),
        *(FIND_FIELDS if finds else ()),
        *flight,
        *(of_vehicles if vehicles else ()),
    )
    return np.dtype([*POINT, (_ALL_FOUND, "u1"), *mask, *further])


def path_of(report: NDArray[Any]) -> NDArray[np.float64]:
    """Return the paths (N, K + 1, 2) of a report in metres."""
    return np.asarray(report[_PATH], np.float64).reshape(len(report), -1, 2)


def looked_of(report: NDArray[Any]) -> NDArray[np.bool_] | None:
    """Return whether drones in metres looked (N, K + 1), if vehicles have flown the step."""
    return report[_LOOKED] > 0 if _LOOKED in (report.dtype.names or ()) else None


def wind_of(report: NDArray[Any]) -> tuple[float, float] | None:
    """Return the wind of a report to the east and to the north, m/s, if vehicles fly in metres."""
    if "wind" not in (report.dtype.names or ()):
        return None
    east, north = report["wind"][0].tolist()
    return east, north


def _dtype_of(num_actions: int, names: Collection[str], path_points: int = 0) -> np.dtype[Any]:
    """Return the layout that has these fields."""
    return step_report_dtype(
        num_actions,
        path_points=path_points,
        coverage={name for name, _ in COVERAGE_FIELDS}.issubset(names),
        faults=any(name in names for name, _ in FAULT_FIELDS),
        finds="finds" in names,
        vehicles="work" in names or _LOOKED in names,
    )


def make_step_report(columns: Mapping[str, ArrayLike]) -> NDArray[Any]:
    """Return the report of all N drones in the order of the agents.

    Args:
        columns: The fields of `step_report_dtype` by name, each for all N drones or one for all,
            with those of coverage, faults, finds and vehicles that there are: action_mask (N, A),
            finds (N,) uint64 bits; in metres path (N, K + 1, 2). Flags are what is true.

    Returns:
        (N,) of a `step_report_dtype`.

    Raises:
        ValueError: If the shapes do not match, or the fields are not those of a report.
    """
    mask, path = np.asarray(columns.get(_MASK, ())), columns.get(_PATH)
    if path is not None:
        columns = {**columns, _PATH: (mask := np.reshape(path, (len(np.asarray(path)), -1)))}
        dtype = _dtype_of(0, columns, mask.shape[1] // 2)
    elif mask.ndim != 2:
        raise ValueError(f"{_MASK} must be of shape (N, A), got {mask.shape}")
    else:
        dtype = _dtype_of(mask.shape[1], columns)
    names = dtype.names or ()
    if set(columns) != set(names):
        odd = ", ".join(sorted(set(columns) ^ set(names)))
        raise ValueError(f"columns must be {', '.join(names)}; missing or unknown: {odd}")
    report = np.zeros(len(mask), dtype=dtype)
    for name, values in columns.items():
        if name == "finds":
            report[name] = np.asarray(values, "<u8").reshape(-1, 1).view("<u4")
        else:
            report[name] = np.asarray(values, bool) if name in FLAGS else values
    return report


def finds_of(report: NDArray[Any]) -> NDArray[np.uint64]:
    """Return which looks of each drone found a person, (N,) bits, of a report that says it."""
    finds: NDArray[np.uint64] = np.ascontiguousarray(report["finds"]).view("<u8")[:, 0]
    return finds


def step_report_message(
    header: Header, report: NDArray[Any], into: PointCloud2 | None = None
) -> PointCloud2:
    """Return a report as a cloud of one row.

    Args:
        header: Time of the step, and the map frame.
        report: (N,) of a `step_report_dtype`.
        into: Message to fill and return, one of this function's own earlier results.

    Raises:
        ValueError: If the array is not a report.
    """
    dtype = report.dtype
    names = dtype.names or ()
    counts = [sum(dtype[name].shape) if name in names else 0 for name in (_MASK, _PATH)]
    if not any(counts) or dtype != _dtype_of(counts[0], names, counts[1] // 2):
        raise ValueError(f"report must be of a step_report_dtype, got {dtype!r:.60}")
    return cloud_message(header, report[np.newaxis], into)


def step_report_from_message(message: PointCloud2) -> NDArray[Any]:
    """Return the report in a cloud: the inverse of `step_report_message`.

    Raises:
        ValueError: If the cloud is not a report.
    """
    if message.height != 1:
        raise ValueError(f"height must be 1, got {message.height}")
    counts = {field.name: field.count for field in message.fields}
    path_points = counts.get(_PATH, 0) // 2
    num_actions = 0 if path_points else counts.get(_MASK, 1)
    names = set(counts)
    report: NDArray[Any] = points_from_message(message, _dtype_of(num_actions, names, path_points))[
        0
    ]
    for name, most in (("status", MAX_STATUS), ("work", MAX_WORK)):
        if name in names and len(report) and report[name].max() > most:
            raise ValueError(f"{name} must be 0 to {most}, got {report[name].max()}")
    return report

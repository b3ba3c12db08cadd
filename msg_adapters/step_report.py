# SPDX-License-Identifier: Apache-2.0
"""The step report: a NumPy structured array to sensor_msgs/PointCloud2 and back.

One entry per drone; x, y, z are float32 metres in the map frame, so that RViz shows the cloud.
"""

from __future__ import annotations

import array
from collections.abc import Mapping
from functools import cache
from typing import Any, Literal

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import PointCloud2, PointField

from msg_adapters.frames import GridFrame, cell_to_map
from msg_adapters.result import shown
from msg_adapters.stamps import header

MAX_ACTIONS = 127
"""Action numbers are int8."""

_FIELDS = (
    ("x", "<f4"),
    ("y", "<f4"),
    ("z", "<f4"),
    ("step", "<u4"),
    ("reward", "<f8"),
    ("col", "<i2"),
    ("row", "<i2"),
    ("action", "i1"),
    ("terminated", "u1"),
    ("truncated", "u1"),
    ("found", "u1"),
    ("held", "u1"),
)
_MASK = "action_mask"
_ORDER: dict[bool, Literal["<", ">"]] = {False: "<", True: ">"}

_DATATYPES = {
    "i1": PointField.INT8,
    "u1": PointField.UINT8,
    "i2": PointField.INT16,
    "u2": PointField.UINT16,
    "i4": PointField.INT32,
    "u4": PointField.UINT32,
    "f4": PointField.FLOAT32,
    "f8": PointField.FLOAT64,
}


@cache
def step_report_dtype(num_actions: int) -> np.dtype[Any]:
    """Return the layout of one drone's entry: packed, little-endian.

    Fields: x, y, z (m, map frame, float32), step (uint32), reward (float64), col, row (int16),
    action (int8: the one applied, -1 if none), terminated, truncated, found, held (uint8: 0 or
    1), action_mask (uint8 x num_actions: 0 if the action would leave the grid).

    Raises:
        ValueError: If the number of actions is not 1 to `MAX_ACTIONS`.
    """
    if not 1 <= num_actions <= MAX_ACTIONS:
        raise ValueError(f"num_actions: {num_actions!r} is not allowed; 1 to {MAX_ACTIONS}")
    return np.dtype([*_FIELDS, (_MASK, "u1", (int(num_actions),))])


def make_step_report(
    frame: GridFrame,
    *,
    step: int,
    cells: ArrayLike,
    actions: ArrayLike,
    rewards: ArrayLike,
    terminated: ArrayLike,
    truncated: ArrayLike,
    found: ArrayLike,
    held: ArrayLike,
    action_mask: ArrayLike,
) -> NDArray[Any]:
    """Return the report of all N drones in the order of the agents.

    Args:
        frame: The grid.
        step: Steps done.
        cells: (N, 2) of (col, row).
        actions: (N,) action numbers applied, -1 for none.
        rewards: (N,) rewards of the step.
        terminated: (N,) flags.
        truncated: (N,) flags.
        found: (N,) flags: the drone found a person in this step.
        held: (N,) flags: no command came in time and the drone was held.
        action_mask: (N, A), 0 where the action would leave the grid.

    Returns:
        (N,) of `step_report_dtype(A)`.

    Raises:
        ValueError: If the shapes do not match.
    """
    cell = np.asarray(cells).reshape(-1, 2)
    mask = np.asarray(action_mask)
    if mask.ndim != 2:
        raise ValueError(f"action_mask: shape {mask.shape} is not allowed; (N, A) is")
    report = np.zeros(len(cell), dtype=step_report_dtype(mask.shape[-1]))
    col, row = cell[:, 0], cell[:, 1]
    report["x"], report["y"] = cell_to_map(frame, col, row)
    report["z"] = frame.alt_m
    report["step"] = step
    report["col"] = col
    report["row"] = row
    report["action"] = actions
    report["reward"] = rewards
    for name, flags in (
        ("terminated", terminated),
        ("truncated", truncated),
        ("found", found),
        ("held", held),
    ):
        report[name] = np.asarray(flags, dtype=bool)
    report[_MASK] = mask
    return report


def step_report_message(
    frame: GridFrame, report: NDArray[Any], stamp: Time, into: PointCloud2 | None = None
) -> PointCloud2:
    """Return a report as a cloud of one row.

    Args:
        frame: The grid.
        report: (N,) of a `step_report_dtype`.
        stamp: Time of the step.
        into: Message to fill and return, one of this function's own earlier results.

    Raises:
        ValueError: If the array is not a report.
    """
    dtype = report.dtype
    fields: Mapping[str, Any] = dtype.fields or {}
    shape: tuple[int, ...] = fields[_MASK][0].shape if _MASK in fields else ()
    if len(shape) != 1 or dtype != step_report_dtype(shape[0]):
        raise ValueError(f"report: {shown(dtype)} is not allowed; a step_report_dtype is")
    message = PointCloud2() if into is None else into
    message.header = header(frame.map_frame, stamp)
    message.height = 1
    message.width = len(report)
    if message.point_step != dtype.itemsize:
        message.fields = [_point_field(name, *fields[name][:2]) for name in dtype.names or ()]
        message.point_step = dtype.itemsize
    message.is_bigendian = False
    message.row_step = dtype.itemsize * len(report)
    message.is_dense = True
    message.data = array.array("B", report.tobytes())
    return message


def step_report_from_message(message: PointCloud2) -> NDArray[Any]:
    """Return the report in a cloud: the inverse of `step_report_message`.

    Fields are found by name, so a relay may have moved them, padded them or added others.

    Raises:
        ValueError: If the cloud is not a report.
    """
    width, point_step = message.width, message.point_step
    if message.height != 1:
        raise ValueError(f"height: {message.height} is not allowed; 1 is")
    if message.row_step != width * point_step or len(message.data) != message.row_step:
        raise ValueError(
            f"data: {len(message.data)} bytes in a row of {message.row_step} are not allowed; "
            f"width {width} x point_step {point_step} are"
        )
    fields = _fields_by_name(message)
    dtype = step_report_dtype(fields[_MASK].count)
    names = dtype.names or ()
    for name in names:
        offset, size = fields[name].offset, dtype[name].itemsize
        if offset + size > point_step:
            raise ValueError(
                f"fields: offset {offset} of {name} is not allowed; "
                f"its {size} bytes must fit the point_step {point_step}"
            )
    report = np.zeros(width, dtype=dtype)
    if width:
        layout: Any = {
            "names": names,
            "formats": [dtype[name].newbyteorder(_ORDER[message.is_bigendian]) for name in names],
            "offsets": [fields[name].offset for name in names],
            "itemsize": point_step,
        }
        points = np.frombuffer(message.data, dtype=np.dtype(layout))
        for name in names:
            report[name] = points[name]
    return report


def _point_field(name: str, dtype: np.dtype[Any], offset: int) -> PointField:
    count = dtype.shape[0] if dtype.shape else 1
    return PointField(name=name, offset=offset, datatype=_datatype(dtype), count=count)


def _datatype(dtype: np.dtype[Any]) -> int:
    return int(_DATATYPES[dtype.base.str[1:]])


def _fields_by_name(message: PointCloud2) -> dict[str, PointField]:
    """Return the fields of a report, each with the type and number that it must have."""
    found: dict[str, PointField] = {}
    wanted = step_report_dtype(1)
    for field in message.fields:
        if field.name in (wanted.names or ()):
            if field.name in found:
                raise ValueError(f"fields: two of the name {field.name} are not allowed")
            found[field.name] = field
    for name in wanted.names or ():
        if name not in found:
            raise ValueError(f"fields: {name} is missing")
        field = found[name]
        if field.datatype != _datatype(wanted[name]):
            raise ValueError(
                f"fields: datatype {field.datatype} of {name} is not allowed; "
                f"{_datatype(wanted[name])} is"
            )
        if name != _MASK and field.count != 1:
            raise ValueError(f"fields: count {field.count} of {name} is not allowed; 1 is")
    return found

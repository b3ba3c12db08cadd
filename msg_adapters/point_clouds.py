# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""NumPy structured arrays as sensor_msgs/PointCloud2 and back: packed, little-endian."""

from __future__ import annotations

import array
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

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


def cloud_message(
    header: Header, points: NDArray[Any], into: PointCloud2 | None = None
) -> PointCloud2:
    """Return points (H, W) of a structured dtype as a cloud of that height and width.

    Args:
        header: Time of the points, and the frame of their coordinates.
        points: Structured array without padding.
        into: Message to fill and return, an earlier result for points of the same dtype.
    """
    dtype = points.dtype
    message = PointCloud2() if into is None else into
    message.header = header
    message.height, message.width = points.shape
    if message.point_step != dtype.itemsize:
        fields: Any = dtype.fields
        message.fields = [_point_field(name, *fields[name][:2]) for name in dtype.names or ()]
        message.point_step = dtype.itemsize
    message.is_bigendian = False
    message.row_step = dtype.itemsize * points.shape[1]
    message.is_dense = True
    message.data = array.array("B", points.tobytes())
    return message


def points_from_message(message: PointCloud2, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return the points (H, W) of a cloud: the inverse of `cloud_message`.

    Fields are found by name, so a relay may have moved them, padded them or added others.

    Raises:
        ValueError: If the cloud is malformed, or a field of the dtype is missing or of another
            type; one line that names it.
    """
    height, width, point_step = message.height, message.width, message.point_step
    row_step = message.row_step
    if row_step != width * point_step or len(message.data) != height * row_step:
        raise ValueError(
            f"data must be {height} rows of width {width} x point_step {point_step} bytes, "
            f"got {len(message.data)} bytes in rows of {row_step}"
        )
    fields = _fields_by_name(message, dtype)
    names = dtype.names or ()
    for name in names:
        offset, size = fields[name].offset, dtype[name].itemsize
        if offset + size > point_step:
            raise ValueError(
                f"fields: {name} must be {size} bytes within the point_step {point_step}, "
                f"got offset {offset}"
            )
    points = np.zeros((height, width), dtype=dtype)
    if points.size:
        layout: Any = {
            "names": names,
            "formats": [dtype[name].newbyteorder(_ORDER[message.is_bigendian]) for name in names],
            "offsets": [fields[name].offset for name in names],
            "itemsize": point_step,
        }
        read = np.frombuffer(message.data, dtype=np.dtype(layout)).reshape(height, width)
        for name in names:
            points[name] = read[name]
    return points


def _point_field(name: str, dtype: np.dtype[Any], offset: int) -> PointField:
    return PointField(name=name, offset=offset, datatype=_datatype(dtype), count=_count(dtype))


def _datatype(dtype: np.dtype[Any]) -> int:
    return int(_DATATYPES[dtype.base.str[1:]])


def _count(dtype: np.dtype[Any]) -> int:
    return dtype.shape[0] if dtype.shape else 1


def _fields_by_name(message: PointCloud2, dtype: np.dtype[Any]) -> dict[str, PointField]:
    """Return the fields of a dtype, each with the type and number that it must have."""
    names = dtype.names or ()
    found: dict[str, PointField] = {}
    for field in message.fields:
        if field.name in names:
            if field.name in found:
                raise ValueError(f"fields must be of different names, got two of {field.name}")
            found[field.name] = field
    for name in names:
        if name not in found:
            raise ValueError(f"fields: {name} is missing")
        field = found[name]
        for what, value, wanted in (
            ("datatype", field.datatype, _datatype(dtype[name])),
            ("count", field.count, _count(dtype[name])),
        ):
            if value != wanted:
                raise ValueError(f"fields: {what} of {name} must be {wanted}, got {value}")
    return found

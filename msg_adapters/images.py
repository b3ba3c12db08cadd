# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The exact probability map as sensor_msgs/Image in 32FC1, and back."""

from __future__ import annotations

import array
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Image
from std_msgs.msg import Header

ENCODING = "32FC1"


def probability_image(header: Header, probability: NDArray[np.floating[Any]]) -> Image:
    """Return the map as little-endian float32, row 0 north.

    Args:
        header: Time of the map, and its frame.
        probability: (R, C) floats, row 0 north.

    Raises:
        ValueError: If the map is no matrix.
    """
    if probability.ndim != 2:
        raise ValueError(f"probability must be a matrix, got {probability.shape}")
    rows, columns = probability.shape
    pixels = np.ascontiguousarray(probability, dtype="<f4")
    data = array.array("B")
    data.frombytes(pixels.data.cast("B"))
    message = Image(header=header)
    message.height = rows
    message.width = columns
    message.encoding = ENCODING
    message.is_bigendian = 0
    message.step = 4 * columns
    message.data = data
    return message


def image_to_probability(message: Image) -> NDArray[np.float32]:
    """Return the map as read-only (R, C) float32, row 0 north; a view where the bytes allow.

    Raises:
        ValueError: If the encoding, the shape or the size of the data is not that of a map.
    """
    rows, columns = message.height, message.width
    if message.encoding != ENCODING:
        raise ValueError(f"encoding must be '{ENCODING}', got {message.encoding!r:.60}")
    if min(rows, columns) < 1:
        raise ValueError(f"width x height must be at least 1 x 1, got {columns} x {rows}")
    if message.step < 4 * columns:
        raise ValueError(f"step must be at least 4 x width, {4 * columns}, got {message.step}")
    if len(message.data) != message.step * rows:
        raise ValueError(
            f"data must be step x height, {message.step * rows} bytes, got {len(message.data)}"
        )
    lines = np.frombuffer(message.data, dtype=np.uint8).reshape(rows, message.step)
    pixels = lines[:, : 4 * columns].view(">f4" if message.is_bigendian else "<f4")
    probability = pixels.astype(np.float32, copy=False)
    probability.flags.writeable = False
    return probability

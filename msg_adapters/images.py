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
        probability: (G, G) floats, row 0 north.

    Raises:
        ValueError: If the map is not square.
    """
    size = len(probability)
    if probability.shape != (size, size):
        raise ValueError(f"probability must be a square matrix, got {probability.shape}")
    pixels = np.ascontiguousarray(probability, dtype="<f4")
    data = array.array("B")
    data.frombytes(pixels.data.cast("B"))
    message = Image(header=header)
    message.height = size
    message.width = size
    message.encoding = ENCODING
    message.is_bigendian = 0
    message.step = 4 * size
    message.data = data
    return message


def image_to_probability(message: Image) -> NDArray[np.float32]:
    """Return the map as read-only (G, G) float32, row 0 north; a view where the bytes allow.

    Raises:
        ValueError: If the encoding, the shape or the size of the data is not that of a map.
    """
    size = message.width
    if message.encoding != ENCODING:
        raise ValueError(f"encoding must be '{ENCODING}', got {message.encoding!r:.60}")
    if size < 1 or message.height != size:
        raise ValueError(f"width x height must be a square, got {size} x {message.height}")
    if message.step < 4 * size:
        raise ValueError(f"step must be at least 4 x width, {4 * size}, got {message.step}")
    if len(message.data) != message.step * size:
        raise ValueError(
            f"data must be step x height, {message.step * size} bytes, got {len(message.data)}"
        )
    rows = np.frombuffer(message.data, dtype=np.uint8).reshape(size, message.step)
    pixels = rows[:, : 4 * size].view(">f4" if message.is_bigendian else "<f4")
    probability = pixels.astype(np.float32, copy=False)
    probability.flags.writeable = False
    return probability

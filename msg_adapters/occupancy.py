# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The probability map as nav_msgs/OccupancyGrid, and back."""

from __future__ import annotations

import array
import math
from typing import Any, TypeVar

import numpy as np
from nav_msgs.msg import OccupancyGrid
from numba import njit
from numpy.typing import NDArray
from std_msgs.msg import Header

SCALINGS = ("max", "linear", "log")
"""Ways from probability to occupancy, the values of the parameter `grid_scaling`."""

LOG_DECADES = 6
"""Decades below the largest probability that scaling `log` spreads over 1 to 100."""

# Below this the factor 100 / max overflows float32.
_TINY = 1e-30


S = TypeVar("S", bound=np.generic)


def matrix_to_map_rows(matrix: NDArray[S]) -> NDArray[S]:
    """Flip a matrix with row 0 in the north to rows from the south up, as a map message has them.

    Its own inverse, and a view: nothing is copied.
    """
    return matrix[::-1]


def probability_to_occupancy(
    probability: NDArray[np.floating[Any]], scaling: str = "max"
) -> NDArray[np.int8]:
    """Return the occupancy (-1 to 100) of each cell.

    With m the largest finite probability, a cell of probability p > 0 becomes
    `max`: 100 p / m; `linear`: 100 p; `log`: 1 + 99 (1 + log10(p / m) / 6) for the 6 decades
    below m and 1 beneath them. The value is rounded, at least 1 and at most 100. A cell of
    p = 0 becomes 0, NaN becomes -1 (unknown) and infinity 100.

    Args:
        probability: (R, C) floats, NaN or not negative, row 0 north; float32 is fastest.
        scaling: One of `SCALINGS`.

    Returns:
        (R, C) int8, row 0 north.

    Raises:
        ValueError: If the scaling is unknown.
    """
    if scaling not in SCALINGS:
        raise ValueError(f"scaling must be one of {', '.join(SCALINGS)}, got {scaling!r}")
    occupancy = np.empty(probability.shape, dtype=np.int8)
    largest = float(probability.max(initial=0.0))
    if not math.isfinite(largest):
        largest = float(probability.max(initial=0.0, where=np.isfinite(probability)))
    if 0 < largest < _TINY:
        probability = probability.astype(np.float64)
    if scaling == "log":
        _write_log(probability, largest, occupancy)
    else:
        factor = 100.0 / largest if scaling == "max" and largest > 0 else 100.0
        _write_linear(probability, probability.dtype.type(factor), occupancy)
    return occupancy


def occupancy_grid(
    header: Header,
    resolution_m: float,
    probability: NDArray[np.floating[Any]],
    scaling: str = "max",
    area: NDArray[np.bool_] | None = None,
) -> OccupancyGrid:
    """Return the map in the map frame, cells from the south-west corner to the east and north.

    Args:
        header: Time of the map, also its load time, and its frame.
        resolution_m: Side of a cell.
        probability: (R, C) floats, row 0 north.
        scaling: As `probability_to_occupancy`.
        area: (R, C) bool, row 0 north: cells that are not in it become -1; None for none.

    Raises:
        ValueError: If the scaling is unknown or the map is no matrix.
    """
    if probability.ndim != 2:
        raise ValueError(f"probability must be a matrix, got {probability.shape}")
    data = array.array("b", [0]) * probability.size
    rows = np.frombuffer(data, dtype=np.int8).reshape(probability.shape)
    rows[...] = matrix_to_map_rows(probability_to_occupancy(probability, scaling))
    if area is not None:
        rows[matrix_to_map_rows(~area)] = -1

    message = OccupancyGrid(header=header)
    message.info.map_load_time = header.stamp
    message.info.resolution = float(resolution_m)
    message.info.height, message.info.width = probability.shape
    message.data = data
    return message


def occupancy_to_array(message: OccupancyGrid) -> NDArray[np.int8]:
    """Return the occupancy of each cell as (height, width) int8, row 0 north.

    Raises:
        ValueError: If the data does not have width times height cells.
    """
    width, height = message.info.width, message.info.height
    if len(message.data) != width * height:
        raise ValueError(
            f"data must be width {width} x height {height} cells, got {len(message.data)}"
        )
    rows = np.frombuffer(message.data, dtype=np.int8).reshape(height, width)
    return matrix_to_map_rows(rows).copy()


@njit(cache=True, nogil=True)
def _write_linear(probability: Any, factor: Any, out: Any) -> None:
    """Write the occupancy of each cell as its probability times a factor, in one pass."""
    for row in range(probability.shape[0]):
        cells, levels = probability[row], out[row]
        for i in range(len(cells)):
            p = cells[i]
            level = np.int32(np.rint(p * factor)) if p * factor < 100 else np.int32(100)
            if level < 1:
                level = np.int32(p > 0)
            levels[i] = level if p == p else np.int32(-1)


@njit(cache=True, nogil=True)
def _write_log(probability: Any, largest: float, out: Any) -> None:
    """Write the occupancy of each cell as the logarithm of its share of the largest."""
    for row in range(probability.shape[0]):
        for col in range(probability.shape[1]):
            p = np.float64(probability[row, col])
            if p > 0.0:
                share = 1.0 + np.log10(p / largest) / LOG_DECADES if p < largest else 1.0
                out[row, col] = max(np.int32(np.rint(1.0 + 99.0 * share)), 1)
            else:
                out[row, col] = 0 if p == p else -1

# SPDX-License-Identifier: Apache-2.0
"""The probability map as nav_msgs/OccupancyGrid, and back."""

from __future__ import annotations

import array
import math
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from nav_msgs.msg import OccupancyGrid
from numpy.typing import NDArray

from msg_adapters.frames import GridFrame, matrix_to_map_rows
from msg_adapters.stamps import header

SCALINGS = ("max", "linear", "log")
"""Ways from probability to occupancy, the values of the parameter `grid_scaling`."""

LOG_DECADES = 6
"""Decades below the largest probability that scaling `log` spreads over 1 to 100."""

# Cells worked on at a time, so that the scratch buffers stay in the cache (measured).
_BLOCK_CELLS = 1 << 18
# Below this the factor 100 / max overflows float32.
_TINY = 1e-30


def probability_to_occupancy(
    probability: NDArray[np.floating[Any]], scaling: str = "max"
) -> NDArray[np.int8]:
    """Return the occupancy (-1 to 100) of each cell.

    With m the largest finite probability, a cell of probability p > 0 becomes
    `max`: 100 p / m; `linear`: 100 p; `log`: 1 + 99 (1 + log10(p / m) / 6) for the 6 decades
    below m and 1 beneath them. The value is rounded, at least 1 and at most 100. A cell of
    p = 0 becomes 0, NaN becomes -1 (unknown) and infinity 100.

    Args:
        probability: (G, G) floats, NaN or not negative, row 0 north; float32 is fastest.
        scaling: One of `SCALINGS`.

    Returns:
        (G, G) int8, row 0 north.

    Raises:
        ValueError: If the scaling is unknown.
    """
    occupancy = np.empty(probability.shape, dtype=np.int8)
    _write_occupancy(probability, scaling, occupancy)
    return occupancy


def occupancy_grid(
    frame: GridFrame,
    probability: NDArray[np.floating[Any]],
    stamp: Time,
    scaling: str = "max",
) -> OccupancyGrid:
    """Return the map in the map frame, cells from the south-west corner to the east and north.

    Args:
        frame: The grid.
        probability: (G, G) floats, row 0 north.
        stamp: Time of the map, also its load time.
        scaling: As `probability_to_occupancy`.

    Raises:
        ValueError: If the scaling is unknown or the shape is not the grid's.
    """
    size = frame.grid_size
    if probability.shape != (size, size):
        raise ValueError(f"probability: shape {probability.shape} is not ({size}, {size})")
    # Written straight into the message's own array: no copy of the whole map on the way.
    data = array.array("b", [0]) * (size * size)
    rows = np.frombuffer(data, dtype=np.int8).reshape(size, size)
    _write_occupancy(probability, scaling, matrix_to_map_rows(rows))

    message = OccupancyGrid(header=header(frame.map_frame, stamp))
    message.info.map_load_time = stamp
    message.info.resolution = frame.cell_size_m
    message.info.width = size
    message.info.height = size
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
            f"data: {len(message.data)} cells are not allowed; width {width} x height {height}"
        )
    rows = np.frombuffer(message.data, dtype=np.int8).reshape(height, width)
    return matrix_to_map_rows(rows).copy()


def _write_occupancy(
    probability: NDArray[np.floating[Any]], scaling: str, out: NDArray[np.int8]
) -> None:
    if scaling not in SCALINGS:
        raise ValueError(f"scaling: {scaling!r} is not allowed; one of {', '.join(SCALINGS)}")
    blocks = _blocks(probability)
    peaks = [float(probability[block].max(initial=0.0)) for block in blocks]
    # A sum of values that are not negative is NaN or infinite as soon as one of them is.
    if not math.isfinite(sum(peaks)) or 0 < max(peaks) < _TINY:
        _write_any(probability, scaling, out)
    else:
        _write_finite(probability, blocks, peaks, scaling, out)


def _blocks(probability: NDArray[np.floating[Any]]) -> list[slice]:
    height, width = probability.shape
    rows = max(1, _BLOCK_CELLS // width)
    return [slice(start, min(start + rows, height)) for start in range(0, height, rows)]


def _write_any(probability: NDArray[np.floating[Any]], scaling: str, out: NDArray[np.int8]) -> None:
    """Write the occupancy of a map with NaN, infinities or only tiny values: slower."""
    wide = probability.astype(np.float64)
    wide[~np.isfinite(wide)] = 0.0
    largest = float(wide.max())
    if scaling != "linear" and largest > 0:
        wide /= largest
    blocks = _blocks(wide)
    peaks = [float(wide[block].max()) for block in blocks]
    _write_finite(wide, blocks, peaks, scaling, out)
    out[np.isnan(probability)] = -1
    out[np.isposinf(probability)] = 100


def _write_finite(
    probability: NDArray[np.floating[Any]],
    blocks: list[slice],
    peaks: list[float],
    scaling: str,
    out: NDArray[np.int8],
) -> None:
    """Write the occupancy of a map with finite values; `peaks` are the blocks' largest."""
    largest = max(peaks)
    shape = (blocks[0].stop, probability.shape[1])
    levels = np.empty(shape, dtype=np.float32)
    signs = np.empty(shape, dtype=np.bool_)
    rounded = np.empty(shape, dtype=np.int8)
    for block, peak in zip(blocks, peaks, strict=True):
        if peak == 0:
            out[block] = 0
            continue
        source = probability[block]
        count = len(source)
        level, cells = levels[:count], rounded[:count]
        np.greater(source, 0, out=signs[:count])
        positive = signs[:count].view(np.int8)
        _LEVELS[scaling](source, largest, level)
        np.rint(level, out=level)
        np.copyto(cells, level, casting="unsafe")
        if scaling == "log":
            np.multiply(cells, positive, out=cells)
        np.maximum(cells, positive, out=cells)
        out[block] = cells


def _max_level(
    source: NDArray[np.floating[Any]], largest: float, level: NDArray[np.float32]
) -> None:
    np.multiply(source, 100.0 / largest, out=level, casting="same_kind")


def _linear_level(
    source: NDArray[np.floating[Any]], largest: float, level: NDArray[np.float32]
) -> None:
    np.minimum(source, 1.0, out=level, casting="same_kind")
    np.multiply(level, 100.0, out=level)


def _log_level(
    source: NDArray[np.floating[Any]], largest: float, level: NDArray[np.float32]
) -> None:
    np.divide(source, largest, out=level, casting="same_kind")
    np.clip(level, 10.0**-LOG_DECADES, 1.0, out=level)
    # The natural logarithm is several times faster than the decadic one.
    np.log(level, out=level)
    np.multiply(level, 99.0 / (LOG_DECADES * math.log(10)), out=level)
    np.add(level, 100.0, out=level)


_LEVELS = {"max": _max_level, "linear": _linear_level, "log": _log_level}

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A map as a PNG of one pixel per cell, whose transparency lets light and dark pages through."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

MAX_SIDE = 500
"""Pixels a side at most: a page has no room for more."""

_BLUE = (0, 114, 178)
_LAND = (150, 150, 150)
_OUTSIDE = 101
"""Index of a cell that is unknown or not searched; the others are levels from 0 to 100."""
_PALETTE = bytes(part for _ in range(_OUTSIDE) for part in _BLUE) + bytes(_LAND)
# Raise low levels, so that unlikely cells differ from impossible ones.
_ALPHA = bytes(round(255 * (level / 100) ** 0.7) for level in range(_OUTSIDE)) + b"\x80"


def map_png(occupancy: NDArray[np.int8]) -> bytes:
    """Return a map as PNG: blue, more opaque for likelier cells; grey for -1.

    Args:
        occupancy: (R, C), -1 to 100, row 0 north. If a pixel has several cells, the highest counts.
    """
    levels = _shrunk(np.clip(occupancy, -1, 100))
    pixels = np.where(levels < 0, _OUTSIDE, levels).astype(np.uint8)
    image = Image.frombytes("P", (pixels.shape[1], pixels.shape[0]), pixels.tobytes())
    image.putpalette(_PALETTE)
    buffer = io.BytesIO()
    image.save(buffer, "PNG", transparency=_ALPHA, compress_level=1)
    return buffer.getvalue()


def level_at(png: bytes, share: tuple[float, float]) -> int | None:
    """Return the level of a map of `map_png` from 0 to 100; None if it is not searched.

    Args:
        png: The map.
        share: Place from the west and the north, as shares of the sides.
    """
    with Image.open(io.BytesIO(png)) as image:
        at = (int(share[0] * image.width), int(share[1] * image.height))
        level = int(np.asarray(image)[at[1], at[0]])
    return None if level == _OUTSIDE else level


def _shrunk(levels: NDArray[np.int8]) -> NDArray[np.int8]:
    """Return blocks of cells as one, so that no side is longer than `MAX_SIDE`."""
    block = -(-max(levels.shape) // MAX_SIDE)
    for axis, side in enumerate(levels.shape):
        levels = np.maximum.reduceat(levels, np.arange(0, side, block), axis=axis)
    return levels

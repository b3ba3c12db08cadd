# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The map on matplotlib axes, in km from its south-west corner, for pictures and reports."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsse_ros.base.grid_shape import GridExtent, GridShape

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

MAX_STROKES = 4
"""Number of searches of a cell that the picture can show as strokes."""
MAX_LINED_CELLS = 50
"""Cells along the longer side up to which lines separate them."""


def places_km(cells: ArrayLike, rows: int, cell_km: float) -> NDArray[np.float64]:
    """Return x and y (K, 2) of the centres of cells (K, 2) as (col, row) of so many rows."""
    places = np.asarray(cells, float).reshape(-1, 2) + 0.5
    places[:, 1] = rows - places[:, 1]
    return places * cell_km


def draw_cells(axes: Axes, values: NDArray[Any], extent_km: GridExtent, **style: Any) -> AxesImage:
    """Draw a value or colour of each cell, (R, C) or (R, C, 4), row 0 in the north."""
    extent = (0.0, extent_km.width, 0.0, extent_km.height)
    return axes.imshow(values, extent=extent, interpolation="nearest", **style)


def draw_outside(
    axes: Axes, area: NDArray[np.bool_], extent_km: GridExtent, colour: str, **style: Any
) -> None:
    """Draw the cells that are not in the search area (R, C)."""
    from matplotlib.colors import ListedColormap

    outside = np.ma.masked_where(area, np.ones(area.shape))
    draw_cells(axes, outside, extent_km, cmap=ListedColormap([colour]), **style)


def draw_lines(axes: Axes, grid: GridShape, extent_km: GridExtent, colour: str) -> None:
    """Draw lines between the cells of a grid."""
    width, height = extent_km
    for draw, count, along, to in (
        (axes.vlines, grid.columns, width, height), (axes.hlines, grid.rows, height, width)
    ):  # fmt: skip
        places = np.linspace(0, along, count + 1)[1:-1]
        draw(places, 0, to, color=colour, linewidth=0.4, zorder=0.5)


def name_axes(axes: Axes, **style: Any) -> None:
    """Label the axes."""
    axes.set_xlabel("east (km)", **style)
    axes.set_ylabel("north (km)", **style)


def fan_out(places: NDArray[np.float64], apart: float, extent: GridExtent) -> NDArray[np.float64]:
    """Return places (N, 2) with those that are the same on a circle around it, in their order.

    Args:
        places: The places on a map, whose corner is at 0, 0.
        apart: Distance between neighbours on such a circle.
        extent: Of the map; no place leaves it.
    """
    fanned, side = places.copy(), min(extent)
    _, group, sizes = np.unique(places, axis=0, return_inverse=True, return_counts=True)
    for number in np.flatnonzero(sizes > 1).tolist():
        members = np.flatnonzero(group.ravel() == number)
        angle = np.pi / 2 - 2 * np.pi * np.arange(len(members)) / len(members)
        radius = min(apart / (2 * np.sin(np.pi / len(members))), side / 4)
        room = min(radius + apart / 2, side / 2)
        middle = np.clip(places[members[0]], room, np.array(extent) - room)
        fanned[members] = middle + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return fanned


def looked_runs(
    track: NDArray[np.float64], looked: NDArray[np.bool_] | None
) -> list[NDArray[np.float64]]:
    """Return the parts of a track (M, 2) on whose legs a drone looked, (M - 1,); None is all."""
    if looked is None:
        return [track]
    turns = np.flatnonzero(np.diff(looked.astype(np.int8), prepend=0, append=0))
    return [track[a : b + 1] for a, b in turns.reshape(-1, 2).tolist()]


def strips_of_tracks(
    tracks: NDArray[np.float64], looked: NDArray[np.bool_] | None, widths: Sequence[float]
) -> tuple[list[NDArray[np.float64]], list[float]]:
    """Return the lines of strips and their widths, of tracks (N, M, 2) with a width each."""
    lines, line_widths = [], []
    for n, width in enumerate(widths):
        runs = looked_runs(tracks[n], None if looked is None else looked[n])
        lines += runs
        line_widths += [width] * len(runs)
    return lines, line_widths


def _strokes(count: int) -> NDArray[np.float64]:
    """Return lines (count, 2, 2) across a cell of side 1, from south-west to north-east."""
    shift = (np.arange(count) + 1) * 2 / (count + 1) - 1
    low, high = np.maximum(shift, 0), np.minimum(shift + 1, 1)
    return np.stack([np.stack([low, low - shift], 1), np.stack([high, high - shift], 1)], 1)


STROKES = [_strokes(count) for count in range(MAX_STROKES + 1)]
"""The strokes through a cell, by number of its searches."""

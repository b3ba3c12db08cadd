# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What makes a map a chart: degrees and minutes along its edges, scale and north."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.picture.theme import Theme
from dsse_ros.world.scenario.geodesy import Origin, surface_to_geodetic

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Marks = tuple[list[float], list[str]]

_SAMPLES = 65
_SCALE_LAYER = 1.8
"""Above cells and searches, below tracks and drones."""
_MINUTES = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300)
"""Possible intervals between two marks of an edge."""


def draw_degrees(axes: Axes, extent_km: GridExtent, origin: Origin, theme: Theme) -> None:
    """Name longitude and latitude along the northern and eastern edges of a whole map.

    Args:
        axes: Axes of the map, in km from its south-west corner.
        extent_km: Of the map.
        origin: See `MissionView.origin`.
        theme: Colours.
    """
    top, right = axes.secondary_xaxis("top"), axes.secondary_yaxis("right")
    width, height = extent_km
    lon, lat = edge_marks(GridExtent(1e3 * width, 1e3 * height), origin)
    # The labels of a short edge would overlap.
    every = [max(1, round(max(extent_km) / side)) for side in extent_km]
    top.set_xticks([width * at for at in lon[0]][:: every[0]], lon[1][:: every[0]])
    right.set_yticks(
        [height * at for at in lat[0]][:: every[1]], lat[1][:: every[1]], rotation=90,
        rotation_mode="default", va="center",
    )  # fmt: skip
    for edge in (top, right):
        edge.tick_params(labelsize=8, length=3, pad=2, colors=theme.soft)
        for spine in edge.spines.values():
            spine.set_color(theme.ink)


def edge_marks(
    extent: GridExtent, origin: Origin, corner_m: tuple[float, float] = (0.0, 0.0)
) -> tuple[Marks, Marks]:
    """Return the marks of longitude along the northern edge, and of latitude along the eastern.

    Args:
        extent: Of the map, m.
        origin: See `MissionView.origin`.
        corner_m: South-west corner of the map, east and north of the origin.

    Returns:
        Places as shares of its width from the west, or of its height from the south, and labels;
        see `degree_marks`.
    """
    along = np.linspace(0.0, 1.0, _SAMPLES)
    west_m, south_m = corner_m
    _, lon = surface_to_geodetic(origin, west_m + extent.width * along, south_m + extent.height)
    lat, _ = surface_to_geodetic(origin, west_m + extent.width, south_m + extent.height * along)
    return degree_marks(along, np.unwrap(lon, period=360.0), "EW"), degree_marks(along, lat, "NS")


def degree_marks(
    along: NDArray[np.float64], degrees: NDArray[np.float64], hemispheres: str
) -> Marks:
    """Return the places and labels of round degrees and minutes along an edge.

    Args:
        along: (S,) places along the edge, increasing.
        degrees: (S,) latitude or longitude there, without a jump.
        hemispheres: Letters for positive and negative degrees.

    Returns:
        Places and labels; none if the edge is close to a pole.
    """
    steps = np.diff(degrees)
    span = float(abs(degrees[-1] - degrees[0]))
    if not ((steps > 0).all() or (steps < 0).all()) or not 0 < span < 90:
        return [], []
    apart = next((m for m in _MINUTES if 60 * span / m <= 4), 900.0)
    low, high = 60 * float(degrees.min()) / apart, 60 * float(degrees.max()) / apart
    minutes = apart * np.arange(math.ceil(low - 1e-9), math.floor(high + 1e-9) + 1)
    order = slice(None, None, 1 if steps[0] > 0 else -1)
    places = np.interp(minutes, 60 * degrees[order], along[order])
    decimals = max(0, -math.floor(math.log10(apart) + 1e-9))
    return places.tolist(), [_degrees(m, decimals, hemispheres) for m in minutes.tolist()]


def _degrees(minutes: float, decimals: int, hemispheres: str) -> str:
    # Longitudes wrap at the antimeridian.
    minutes = (minutes + 10800.0) % 21600.0 - 10800.0 if hemispheres == "EW" else minutes
    shown = round(abs(minutes), decimals)
    width = 2 + decimals + bool(decimals)
    letter = hemispheres[minutes < 0]
    return f"{int(shown // 60)}°{shown % 60:0{width}.{decimals}f}′{letter}"  # noqa: RUF001


def round_length(most: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... times a power of ten that is at most this."""
    power = 10.0 ** math.floor(math.log10(most))
    return max(factor * power for factor in (1, 2, 5) if factor * power <= most * (1 + 1e-9))


def draw_scale(axes: Axes, corner_km: tuple[float, float], side_km: float, theme: Theme) -> None:
    """Draw the scale and north in the south of a map, in its units, so that any size is right.

    Args:
        axes: Axes of the map.
        corner_km: The south-western corner of the place for it, which is half of the side wide.
        side_km: Side of the part of the map that is shown.
        theme: Colours.
    """
    from matplotlib.patheffects import withStroke

    length = round_length(0.3 * side_km)
    left, bottom, tick = (
        corner_km[0] + 0.03 * side_km,
        corner_km[1] + 0.03 * side_km,
        0.012 * side_km,
    )
    north = left + length + 0.07 * side_km
    style: dict[str, Any] = {"color": theme.ink, "zorder": _SCALE_LAYER, "clip_on": True}
    halo = [withStroke(linewidth=3.5, foreground=theme.paper)]
    for x, y in (
        ([left, left, left + length, left + length], [tick, 0.0, 0.0, tick]),
        ([north, north], [0.0, 0.075 * side_km]),
        (
            [north - 0.7 * tick, north, north + 0.7 * tick],
            [0.075 * side_km - 1.6 * tick, 0.075 * side_km, 0.075 * side_km - 1.6 * tick],
        ),
    ):
        axes.plot(
            x, [bottom + each for each in y], linewidth=1.6, solid_joinstyle="miter",
            path_effects=halo, **style,
        )  # fmt: skip
    text = f"{length:g} km" if length >= 1 else f"{1e3 * length:g} m"
    for middle, shown in ((left + length / 2, text), (north + 0.03 * side_km, "N")):
        axes.text(
            middle, bottom + tick, shown, ha="center", va="bottom", fontsize=9, fontweight="bold",
            path_effects=halo, **style,
        )  # fmt: skip

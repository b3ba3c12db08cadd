# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Chart elements around the map: degrees and minutes along the edges, scale bar, north arrow."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.geodesy import Origin, surface_to_geodetic

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Marks = tuple[list[float], list[str]]

_SAMPLES = 65
_MINUTES = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300)
"""Possible intervals between two marks of an edge."""


def draw_chart(
    axes: Axes, side_km: float, origin: Origin | None, scale: tuple[float, float]
) -> None:
    """Draw the chart elements around a map.

    Args:
        axes: Axes of the map, in km from its south-west corner.
        side_km: Side of the map.
        origin: See `MissionView.origin`.
        scale: Left and bottom of scale and north, in sides of the map.
    """
    if origin is not None:
        _draw_degrees(axes, side_km, origin)
    _draw_scale(axes, side_km, scale)


def _draw_degrees(axes: Axes, side_km: float, origin: Origin) -> None:
    top, right = axes.secondary_xaxis("top"), axes.secondary_yaxis("right")
    lon, lat = edge_marks(1e3 * side_km, origin)
    top.set_xticks([side_km * at for at in lon[0]], lon[1])
    right.set_yticks(
        [side_km * at for at in lat[0]], lat[1], rotation=90, rotation_mode="default", va="center"
    )
    for edge in (top, right):
        edge.tick_params(labelsize=8, length=3, pad=2, colors="0.3")


def edge_marks(
    side_m: float, origin: Origin, corner_m: tuple[float, float] = (0.0, 0.0)
) -> tuple[Marks, Marks]:
    """Return the marks of longitude along the northern edge, and of latitude along the eastern.

    Args:
        side_m: Side of the map.
        origin: See `MissionView.origin`.
        corner_m: South-west corner of the map, east and north of the origin.

    Returns:
        Places as shares of the side from its west or south, and labels; see `degree_marks`.
    """
    along = np.linspace(0.0, 1.0, _SAMPLES)
    west_m, south_m = corner_m
    _, lon = surface_to_geodetic(origin, west_m + side_m * along, south_m + side_m)
    lat, _ = surface_to_geodetic(origin, west_m + side_m, south_m + side_m * along)
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


def _draw_scale(axes: Axes, side_km: float, place: tuple[float, float]) -> None:
    """Draw north and the scale, in the map's units so that it is right at any size."""
    length = round_length(0.3 * side_km)
    left, bottom = (side_km * share for share in place)
    style: dict[str, Any] = {"color": "black", "clip_on": False}
    tick = 0.012 * side_km
    axes.plot(
        [left, left, left + length, left + length],
        [bottom + tick, bottom, bottom, bottom + tick],
        linewidth=1.5, solid_joinstyle="miter", **style,
    )  # fmt: skip
    text = f"{length:g} km" if length >= 1 else f"{1e3 * length:g} m"
    axes.text(left + length / 2, bottom + 2 * tick, text, ha="center", va="bottom", fontsize=9)
    north = left + 0.41 * side_km
    axes.annotate(
        "N", xy=(north, bottom + 0.1 * side_km), xytext=(north, bottom), ha="center", va="bottom",
        fontsize=10, fontweight="bold", annotation_clip=False, clip_on=False,
        arrowprops={"arrowstyle": "-|>", "color": "black", "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip

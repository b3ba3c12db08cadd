# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Shore and sightings on the map, and wind and current in its corner."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.picture.legend import lkp_styles, shore_style
from dsse_ros.picture.theme import Theme
from dsse_ros.world.scenario.sea_state import SeaState

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HALF_ARROW = 0.025
"""Half of an arrow, as a share of the map."""


def draw_shore(axes: Axes, sea: SeaState, theme: Theme) -> None:
    """Draw the land, through which the cells can be seen, on axes in km."""
    from matplotlib.collections import PolyCollection

    rings = [ring / 1000.0 for ring in sea.shore]
    axes.add_collection(PolyCollection(rings, **shore_style(theme), zorder=0.6), autolim=False)


class CornerRow(NamedTuple):
    """An arrow with its label in the corner of a map.

    Attributes:
        kind: `wind`, `current` or `lkp`.
        east: To where the arrow points, of any length above 0.
        north: Likewise.
        label: Its label.
    """

    kind: str
    east: float
    north: float
    label: str


def label_sides(
    sea: SeaState, extent: GridExtent, corner_m: tuple[float, float] = (0.0, 0.0)
) -> list[tuple[int, int] | None]:
    """Return on which side of each sighting its label stands, so that the map does not cut it.

    Args:
        sea: The sea.
        extent: Of the map, m.
        corner_m: Its south-west corner.

    Returns:
        1 or -1 for east or west, and for north or south; None for a sighting off the map.
    """
    shares = [
        ((seen.x_m - corner_m[0]) / extent.width, (seen.y_m - corner_m[1]) / extent.height)
        for seen in sea.sightings
    ]
    return [
        # The labels of two sightings close together do not meet.
        (-1 if x > 0.7 else 1, 1 if y < 0.07 or (number % 2 and y < 0.93) else -1)
        if 0 <= x <= 1 and 0 <= y <= 1
        else None
        for number, (x, y) in enumerate(shares)
    ]


def corner_rows(sea: SeaState, extent: GridExtent) -> list[CornerRow]:
    """Return wind and current unless unknown or calm, then the sightings that are off the map."""
    rows = [
        CornerRow(flow.kind, *flow.velocity_mps, flow.label)
        for flow in sea.flows
        if flow.speed_mps > 0
    ]
    for seen, side in zip(sea.sightings, label_sides(sea, extent), strict=True):
        if side is None:
            east, north = seen.x_m - extent.width / 2, seen.y_m - extent.height / 2
            bearing = round(math.degrees(math.atan2(east, north))) % 360
            away = f"{math.hypot(east, north) / 1000:.1f} km, {bearing:03d}° from the centre"
            rows.append(CornerRow("lkp", east, north, f"{seen.label}: {away}"))
    return rows


def draw_sightings(
    axes: Axes, sea: SeaState, extent_km: GridExtent, theme: Theme,
    corner_km: tuple[float, float] = (0.0, 0.0),
) -> None:  # fmt: skip
    """Draw last known positions as fixes of a chart, with the circles of their uncertainty.

    Areas, voyages and bearings have their lines too.

    Args:
        axes: Axes of the map.
        sea: The sea.
        extent_km: Of the part of the map that is shown.
        theme: Colours.
        corner_km: The south-west corner of that part.
    """
    around = np.linspace(0, math.tau, 91)
    corner_m = (1000.0 * corner_km[0], 1000.0 * corner_km[1])
    extent = GridExtent(1000.0 * extent_km.width, 1000.0 * extent_km.height)
    sides = label_sides(sea, extent, corner_m)
    for seen, side in zip(sea.sightings, sides, strict=True):
        x, y, radius = seen.x_m / 1000, seen.y_m / 1000, seen.radius_m / 1000
        for line in seen.lines:
            axes.plot(*(line / 1000).T, color=theme.lkp, linewidth=1.2, zorder=1.5)
        if radius:
            axes.plot(
                x + radius * np.cos(around), y + radius * np.sin(around), color=theme.lkp,
                linewidth=1.2, zorder=1.5,
            )  # fmt: skip
        if side is None:
            continue
        for style in lkp_styles(theme):
            axes.plot([x], [y], **style)
        axes.annotate(
            seen.label, (x, y), xytext=(9 * side[0], 9 * side[1]), textcoords="offset points",
            ha="left" if side[0] > 0 else "right", va="center",
            fontsize=8.5, fontweight="bold", color=theme.lkp, zorder=5.4, annotation_clip=True,
            clip_on=True,
            bbox={"facecolor": theme.paper, "edgecolor": "none", "alpha": 0.75, "pad": 1.0},
        )  # fmt: skip


def draw_corner(axes: Axes, rows: list[CornerRow], theme: Theme) -> None:
    """Draw arrows and labels in the north-west corner of the map."""
    for number, (kind, east, north, label) in enumerate(rows):
        colour = {"wind": theme.wind, "current": theme.current, "lkp": theme.lkp}[kind]
        x, y = 0.05, 0.95 - 0.065 * number
        along = _HALF_ARROW / math.hypot(east, north)
        axes.annotate(
            "", xy=(x + along * east, y + along * north),
            xytext=(x - along * east, y - along * north), xycoords="axes fraction", zorder=5.5,
            clip_on=True,
            arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2.0, "shrinkA": 0,
                        "shrinkB": 0},
        )  # fmt: skip
        axes.text(
            x + 0.05, y, label, transform=axes.transAxes, va="center", fontsize=8.5, zorder=5.5,
            color=colour, clip_on=True,
            bbox={"facecolor": theme.paper, "edgecolor": "none", "alpha": 0.75, "pad": 1.5},
        )  # fmt: skip

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The shore on the map, and wind and current in its corner."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from dsse_ros.scenario.sea_state import SeaFlow, SeaState
from dsse_ros.view.legend import SHORE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS = {"wind": "#5b2a86", "current": "#00606b"}
_KNOTS = 3600 / 1852
"""A metre per second in knots."""
_HALF_ARROW = 0.025
"""Half of an arrow, as a share of the map."""


def draw_shore(axes: Axes, sea: SeaState) -> None:
    """Draw the land, through which the cells can be seen, on axes in km."""
    from matplotlib.collections import PolyCollection

    rings = [ring / 1000.0 for ring in sea.shore]
    axes.add_collection(PolyCollection(rings, **SHORE, zorder=0.6), autolim=False)


def flow_labels(sea: SeaState) -> list[tuple[SeaFlow, str]]:
    """Return wind and current with a label each, if they are known and not calm."""
    return [
        (
            flow,
            f"{flow.kind} {flow.speed_mps:.1f} m/s ({flow.speed_mps * _KNOTS:.1f} kn) "
            f"{flow.sense} {round(flow.direction_deg) % 360:03d}°",
        )
        for flow in sea.flows
        if flow.speed_mps > 0
    ]


def draw_flows(axes: Axes, sea: SeaState) -> None:
    """Draw an arrow and a label each, in the north-west corner of the map."""
    for row, (flow, label) in enumerate(flow_labels(sea)):
        (east, north), colour = flow.velocity_mps, _COLOURS[flow.kind]
        x, y = 0.05, 0.95 - 0.065 * row
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
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.5},
        )  # fmt: skip

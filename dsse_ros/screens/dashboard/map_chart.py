# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a map shows of its place: shore, sightings, degrees along its edges, scale."""

from __future__ import annotations

from typing import Any, NamedTuple

from dsse_ros.base.grid_shape import GridExtent
from dsse_ros.picture.chart import edge_marks, round_length
from dsse_ros.picture.sea_chart import label_sides
from dsse_ros.picture.theme import DRONE_COLOURS
from dsse_ros.world.scenario.agents import AgentsInfo
from dsse_ros.world.scenario.frames import GridFrame, flip_y
from dsse_ros.world.scenario.sea_state import SeaState


class Window(NamedTuple):
    """The part of the map that is shown.

    Attributes:
        west: Its western edge, as a share of the map's longer side.
        north: Its northern edge, likewise from the north.
        zoom: How many times its side fits into the map's.
    """

    west: float = 0.0
    north: float = 0.0
    zoom: float = 1.0


def map_shares(frame: GridFrame, x_m: float, y_m: float) -> tuple[float, float]:
    """Return a point of the map frame in shares of the map's longer side from west and north."""
    side_m = max(frame.extent)
    return x_m / side_m, flip_y(frame.extent.height, y_m) / side_m


def chart_of(info: AgentsInfo, sea: SeaState) -> dict[str, Any]:
    """Return what a map has of its place, in shares of its longer side from west and north.

    The keys are shore (rings of points), sightings (point, radius, label, its
    side, see `label_sides`, and lines of points), and the colours of the drones.
    """
    frame = info.frame
    side_m = max(frame.extent)

    def point(x_m: float, y_m: float) -> list[float]:
        return [*map_shares(frame, x_m, y_m)]

    return {
        "shore": [[point(*place) for place in ring.tolist()] for ring in sea.shore],
        "sightings": [
            [
                point(seen.x_m, seen.y_m),
                seen.radius_m / side_m,
                seen.label,
                label_side,
                [[point(*place) for place in line.tolist()] for line in seen.lines],
            ]
            for seen, label_side in zip(sea.sightings, label_sides(sea, frame.extent), strict=True)
        ],  # fmt: skip
        "colours": DRONE_COLOURS,
    }


def edges_of(info: AgentsInfo, window: Window) -> dict[str, Any]:
    """Return the marks and the scale of a window, in shares of the map's longer side.

    The keys are marks (places from the west and labels of longitude, places from the north and
    labels of latitude), and scale (length and label).
    """
    side_m, height_m = max(info.frame.extent), info.frame.extent.height
    west, north, share = window.west, window.north, 1.0 / window.zoom
    (easts, lons), (norths, lats) = edge_marks(
        GridExtent(share * side_m, share * side_m),
        info.frame.origin,
        (west * side_m, flip_y(height_m, (north + share) * side_m)),
    )
    marks = (
        ([west + share * at for at in easts], lons),
        ([north + share * (1.0 - at) for at in norths], lats),
    )
    return {"marks": marks, "scale": _scale(side_m, share * side_m)}


def _scale(side_m: float, shown_m: float) -> tuple[float, str]:
    """Return the length of a scale bar, as a share of the map's longer side, and its label.

    Args:
        side_m: Longer side of the map.
        shown_m: Side of the window.
    """
    length_m = round_length(shown_m / 4.0)
    label = f"{length_m:g} m" if length_m < 1000 else f"{length_m / 1000:g} km"
    return length_m / side_m, label

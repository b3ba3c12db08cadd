# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search as visualization_msgs/MarkerArray for RViz."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Iterable, Sequence

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from numpy.typing import ArrayLike
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from dsse_ros.mission_items.tracks import corners
from dsse_ros.scenario.frames import GridFrame, cell_to_map
from dsse_ros.scenario.sea_state import SeaState
from msg_adapters.stamps import header

Rgb = tuple[float, float, float]

_GREY: Rgb = (0.5, 0.5, 0.5)
_WHITE: Rgb = (1.0, 1.0, 1.0)
_DATUM: Rgb = (1.0, 0.85, 0.1)
_LOST: Rgb = (1.0, 0.2, 0.1)
_SAVED: Rgb = (0.2, 0.9, 0.3)
_OF_FLOWS: dict[str, tuple[float, Rgb]] = {
    "wind": (60.0, (0.9, 0.9, 0.9)),
    "current": (600.0, (0.2, 0.7, 1.0)),
}
"""Seconds of its way that the arrow of each shows, and its colour."""
_SHORE: Rgb = (0.8, 0.7, 0.4)
_LKP: Rgb = (1.0, 0.35, 0.85)

_CIRCLE_SEGMENTS = 72
# Successive hues this far apart (the golden ratio) never come close to each other.
_HUE_STEP = 0.6180339887498949


def drone_color(index: int) -> Rgb:
    """Return the red, green and blue (0 to 1) of a drone."""
    red, green, blue = colorsys.hsv_to_rgb((0.55 + index * _HUE_STEP) % 1.0, 0.75, 1.0)
    return red, green, blue


def marker_array(
    frame: GridFrame,
    stamp: Time,
    *,
    drone_cells: ArrayLike,
    names: Sequence[str],
    tracks: Sequence[ArrayLike],
    live: Sequence[bool],
    datum: Sequence[float] | None,
    radius_cells: float | None = None,
    person_cells: ArrayLike | None = None,
    found: Sequence[bool] | None = None,
    sea: SeaState | None = None,
) -> MarkerArray:
    """Return drones, tracks, datum and circle, and the persons when they are given.

    The first marker deletes all earlier ones. Namespaces: `drones`, `names`, `tracks` and
    `persons`, with the index as id, `datum`, `circle`, `wind`, `current`, `shore`, `lkp` and
    `sea_names`. The arrow of the wind is as long as its way in a minute, that of the current as its
    way in ten. A last known position is a disc in the circle of its uncertainty.

    Args:
        frame: The grid.
        stamp: Time of the state.
        drone_cells: (N, 2) of (col, row).
        names: The N names.
        tracks: N tracks, each (K, 2) of (col, row).
        live: N flags; a drone out of the search is grey.
        datum: Cell (col, row) of the datum, a fraction lies between cells; None to leave out.
        radius_cells: Radius of the circle about the datum; None to leave out.
        person_cells: (M, 2) cells of the persons; None to leave out.
        found: M flags; none is found if not given.
        sea: Wind, current, shore and sightings; None to leave out.

    Raises:
        ValueError: If the numbers of names, tracks, flags and cells differ.
    """
    head = header(frame.map_frame, stamp)
    cell_m = frame.cell_size_m

    def marker(namespace: str, number: int, kind: int, scale: Rgb, color: Rgb) -> Marker:
        made = Marker(header=head, ns=namespace, id=number, type=kind, action=Marker.ADD)
        made.scale.x, made.scale.y, made.scale.z = (float(side) for side in scale)
        made.color = ColorRGBA(r=color[0], g=color[1], b=color[2], a=1.0)
        return made

    def line(namespace: str, number: int, width_m: float, color: Rgb) -> Marker:
        return marker(namespace, number, Marker.LINE_STRIP, (width_m, 0.0, 0.0), color)

    def text(namespace: str, number: int, shown: str, place: Point, color: Rgb) -> Marker:
        size = (0.0, 0.0, 0.5 * cell_m)
        made = marker(namespace, number, Marker.TEXT_VIEW_FACING, size, color)
        made.pose.position, made.text = place, shown
        return made

    markers = [Marker(header=head, action=Marker.DELETEALL)]
    cells = np.asarray(drone_cells, dtype=np.float64).reshape(-1, 2)
    places = _points(frame, cells, 0.0)
    altitudes = frame.altitudes_m(len(cells))
    for number, (place, alt_m, name, track, flies) in enumerate(
        zip(places, altitudes, names, tracks, live, strict=True)
    ):
        place.z = alt_m
        color = drone_color(number) if flies else _GREY
        side_m = 0.5 * cell_m
        body = marker("drones", number, Marker.SPHERE, (side_m, side_m, 0.5 * side_m), color)
        body.pose.position = place
        above = Point(x=place.x, y=place.y, z=place.z + cell_m)
        markers += [body, text("names", number, name, above, _WHITE)]
        turns = corners(track)
        if len(turns) > 1:
            flown = line("tracks", number, 0.08 * cell_m, color)
            flown.points = _points(frame, turns, alt_m)
            markers.append(flown)

    if datum is not None:
        (centre,) = _points(frame, [datum], 0.0)
        cross = marker("datum", 0, Marker.LINE_LIST, (0.08 * cell_m, 0.0, 0.0), _DATUM)
        cross.points = [
            Point(x=centre.x + dx * cell_m, y=centre.y + dy * cell_m, z=0.0)
            for dx, dy in ((-0.5, -0.5), (0.5, 0.5), (-0.5, 0.5), (0.5, -0.5))
        ]
        markers.append(cross)
        if radius_cells is not None:
            circle = line("circle", 0, 0.05 * cell_m, _DATUM)
            circle.points = list(_circle(centre, float(radius_cells) * cell_m))
            markers.append(circle)

    if person_cells is not None:
        places = _points(frame, person_cells, 0.0)
        flags = [False] * len(places) if found is None else found
        for number, (place, saved) in enumerate(zip(places, flags, strict=True)):
            side_m = 0.4 * cell_m
            color = _SAVED if saved else _LOST
            person = marker("persons", number, Marker.CYLINDER, (side_m,) * 3, color)
            person.pose.position = place
            markers.append(person)
    if sea is not None:
        size, middle_m = 0.15 * cell_m, 0.5 * frame.grid_size * cell_m
        start = Point(x=middle_m, y=middle_m, z=0.0)
        for flow in sea.flows:
            time_s, color = _OF_FLOWS[flow.kind]
            # An arrow between two points: width of shaft and head, length of head.
            arrow = marker(flow.kind, 0, Marker.ARROW, (size, 3 * size, 3 * size), color)
            east_m, north_m = (time_s * part for part in flow.velocity_mps)
            end = Point(x=start.x + east_m, y=start.y + north_m, z=0.0)
            arrow.points = [start, end]
            markers += [arrow, text("sea_names", len(markers), flow.label, end, color)]
        for number, ring in enumerate(sea.shore):
            shore = line("shore", number, 0.08 * cell_m, _SHORE)
            closed = np.vstack([ring, ring[:1]])
            shore.points = [Point(x=x, y=y, z=0.0) for x, y in closed.tolist()]
            markers.append(shore)
        for number, seen in enumerate(sea.sightings):
            place, size = Point(x=seen.x_m, y=seen.y_m, z=0.0), 0.3 * cell_m
            fix = marker("lkp", 2 * number, Marker.CYLINDER, (size, size, 0.1 * size), _LKP)
            fix.pose.position = place
            # A sighting may be exact; a fix of a chart has a circle all the same.
            around = line("lkp", 2 * number + 1, 0.06 * cell_m, _LKP)
            around.points = list(_circle(place, max(seen.radius_m, size)))
            below = Point(x=seen.x_m, y=seen.y_m - 0.6 * cell_m, z=0.0)
            markers += [fix, around, text("sea_names", len(markers), seen.label, below, _LKP)]
    return MarkerArray(markers=markers)


def _points(frame: GridFrame, cells: ArrayLike, z_m: float) -> list[Point]:
    array = np.asarray(cells, dtype=np.float64).reshape(-1, 2)
    x_m, y_m = cell_to_map(frame, array[:, 0], array[:, 1])
    return [Point(x=x, y=y, z=z_m) for x, y in zip(x_m.tolist(), y_m.tolist(), strict=True)]


def _circle(centre: Point, radius_m: float) -> Iterable[Point]:
    for index in range(_CIRCLE_SEGMENTS + 1):
        angle = math.tau * index / _CIRCLE_SEGMENTS
        yield Point(
            x=centre.x + radius_m * math.cos(angle), y=centre.y + radius_m * math.sin(angle), z=0.0
        )

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The search as visualization_msgs/MarkerArray for RViz."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters.poses import Position

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


class ShownDrone(NamedTuple):
    """A drone.

    Attributes:
        name: Its name.
        position: Where it is.
        track: Corners of its way.
        live: Whether it takes part in the search; one that does not is grey.
    """

    name: str
    position: Position
    track: Sequence[Position]
    live: bool


class ShownPerson(NamedTuple):
    """A person: where it is, and whether it has been found."""

    position: Position
    found: bool


class ShownFlow(NamedTuple):
    """Wind or current.

    Attributes:
        kind: `wind` or `current`.
        velocity_mps: Velocity (east, north).
        label: Text at the arrow.
    """

    kind: str
    velocity_mps: tuple[float, float]
    label: str


class ShownSighting(NamedTuple):
    """A last known position.

    Attributes:
        position: Its middle.
        radius_m: Radius of the circle of its uncertainty.
        label: Text below it.
        lines: Lines (K, 2) of x and y in metres: the outline of an area, or a voyage.
    """

    position: Position
    radius_m: float
    label: str
    lines: Sequence[NDArray[Any]] = ()


class Scene(NamedTuple):
    """What the markers show.

    Attributes:
        cell_size_m: Side of a cell, by which sizes are chosen.
        width_m: Width of the grid, in whose middle the arrows begin.
        height_m: Its height.
        drones: In the order of the agents.
        datum: Where the search is about; None to leave out.
        radius_m: Radius of the circle about the datum; None to leave out.
        persons: Those to show.
        flows: Wind and current.
        shore: Rings (K, 2) of x and y in metres; the last point is joined to the first.
        sightings: Last known positions.
    """

    cell_size_m: float
    width_m: float
    height_m: float
    drones: Sequence[ShownDrone] = ()
    datum: Position | None = None
    radius_m: float | None = None
    persons: Sequence[ShownPerson] = ()
    flows: Sequence[ShownFlow] = ()
    shore: Sequence[NDArray[Any]] = ()
    sightings: Sequence[ShownSighting] = ()


def marker_array(header: Header, scene: Scene) -> MarkerArray:
    """Return drones, tracks, datum and circle, persons, and the sea.

    The first marker deletes all earlier ones. Namespaces: `drones`, `names`, `tracks` and
    `persons`, with the index as id, `datum`, `circle`, `wind`, `current`, `shore`, `lkp`,
    `lkp_lines` and `sea_names`. The arrow of the wind is as long as its way in a minute, that of
    the current as its way in ten. A last known position is a disc in the circle of its uncertainty.

    Args:
        header: Time of the state, and the map frame.
        scene: What to show.
    """
    markers = _Markers(header, scene.cell_size_m)
    for number, drone in enumerate(scene.drones):
        markers.add_drone(number, drone)
    if scene.datum is not None:
        markers.add_datum(_point(scene.datum), scene.radius_m)
    for number, person in enumerate(scene.persons):
        markers.add_person(number, person)
    middle = Point(x=0.5 * scene.width_m, y=0.5 * scene.height_m, z=0.0)
    for flow in scene.flows:
        markers.add_flow(middle, flow)
    for number, ring in enumerate(scene.shore):
        markers.add_shore(number, ring)
    for number, seen in enumerate(scene.sightings):
        markers.add_sighting(number, seen)
    return MarkerArray(markers=markers.messages)


class _Markers:
    """Makes markers, and deletes all earlier ones."""

    def __init__(self, header: Header, cell_m: float) -> None:
        self._header = header
        self._cell_m = cell_m
        self.messages = [Marker(header=header, action=Marker.DELETEALL)]

    def _add(self, namespace: str, number: int, kind: int, scale: Rgb, color: Rgb) -> Marker:
        marker = Marker(header=self._header, ns=namespace, id=number, type=kind, action=Marker.ADD)
        marker.scale.x, marker.scale.y, marker.scale.z = (float(side) for side in scale)
        marker.color = ColorRGBA(r=color[0], g=color[1], b=color[2], a=1.0)
        self.messages.append(marker)
        return marker

    def _add_line(
        self, namespace: str, number: int, width_m: float, color: Rgb, points: Iterable[Point]
    ) -> None:
        line = self._add(namespace, number, Marker.LINE_STRIP, (width_m, 0.0, 0.0), color)
        line.points = list(points)

    def _add_text(self, namespace: str, number: int, text: str, place: Point, color: Rgb) -> None:
        size = (0.0, 0.0, 0.5 * self._cell_m)
        marker = self._add(namespace, number, Marker.TEXT_VIEW_FACING, size, color)
        marker.pose.position, marker.text = place, text

    def add_drone(self, number: int, drone: ShownDrone) -> None:
        """Add a drone, its name and its track."""
        color = drone_color(number) if drone.live else _GREY
        side_m = 0.5 * self._cell_m
        size = (side_m, side_m, 0.5 * side_m)
        body = self._add("drones", number, Marker.SPHERE, size, color)
        body.pose.position = _point(drone.position)
        x, y, z = drone.position
        above = Point(x=x, y=y, z=z + self._cell_m)
        self._add_text("names", number, drone.name, above, _WHITE)
        if len(drone.track) > 1:
            track = map(_point, drone.track)
            self._add_line("tracks", number, 0.08 * self._cell_m, color, track)

    def add_datum(self, centre: Point, radius_m: float | None) -> None:
        """Add the datum, and the circle about it if there is one."""
        cell_m = self._cell_m
        cross = self._add("datum", 0, Marker.LINE_LIST, (0.08 * cell_m, 0.0, 0.0), _DATUM)
        cross.points = [
            Point(x=centre.x + dx * cell_m, y=centre.y + dy * cell_m, z=0.0)
            for dx, dy in ((-0.5, -0.5), (0.5, 0.5), (-0.5, 0.5), (0.5, -0.5))
        ]
        if radius_m is not None:
            self._add_line("circle", 0, 0.05 * cell_m, _DATUM, _circle(centre, radius_m))

    def add_person(self, number: int, person: ShownPerson) -> None:
        """Add a person."""
        side_m = 0.4 * self._cell_m
        color = _SAVED if person.found else _LOST
        marker = self._add("persons", number, Marker.CYLINDER, (side_m,) * 3, color)
        marker.pose.position = _point(person.position)

    def add_flow(self, start: Point, flow: ShownFlow) -> None:
        """Add the arrow of wind or current, and its name."""
        number, size = len(self.messages), 0.15 * self._cell_m
        time_s, color = _OF_FLOWS[flow.kind]
        # An arrow between two points: width of shaft and head, length of head.
        arrow = self._add(flow.kind, 0, Marker.ARROW, (size, 3 * size, 3 * size), color)
        east_m, north_m = (time_s * part for part in flow.velocity_mps)
        end = Point(x=start.x + east_m, y=start.y + north_m, z=0.0)
        arrow.points = [start, end]
        self._add_text("sea_names", number, flow.label, end, color)

    def add_shore(self, number: int, ring: NDArray[Any]) -> None:
        """Add a ring of the shore."""
        closed = np.vstack([ring, ring[:1]])
        points = [Point(x=x, y=y, z=0.0) for x, y in closed.tolist()]
        self._add_line("shore", number, 0.08 * self._cell_m, _SHORE, points)

    def add_sighting(self, number: int, seen: ShownSighting) -> None:
        """Add a last known position, its circle and its name."""
        name_number, place, size = len(self.messages), _point(seen.position), 0.3 * self._cell_m
        fix = self._add("lkp", 2 * number, Marker.CYLINDER, (size, size, 0.1 * size), _LKP)
        fix.pose.position = place
        # A sighting may be exact; a fix of a chart has a circle all the same.
        around = _circle(place, max(seen.radius_m, size))
        self._add_line("lkp", 2 * number + 1, 0.06 * self._cell_m, _LKP, around)
        below = Point(x=place.x, y=place.y - 0.6 * self._cell_m, z=0.0)
        self._add_text("sea_names", name_number, seen.label, below, _LKP)
        for line in seen.lines:
            points = [Point(x=x, y=y, z=0.0) for x, y in line.tolist()]
            self._add_line("lkp_lines", len(self.messages), 0.06 * self._cell_m, _LKP, points)


def _point(position: Position) -> Point:
    x, y, z = position
    return Point(x=x, y=y, z=z)


def _circle(centre: Point, radius_m: float) -> Iterable[Point]:
    for index in range(_CIRCLE_SEGMENTS + 1):
        angle = math.tau * index / _CIRCLE_SEGMENTS
        yield Point(
            x=centre.x + radius_m * math.cos(angle), y=centre.y + radius_m * math.sin(angle), z=0.0
        )

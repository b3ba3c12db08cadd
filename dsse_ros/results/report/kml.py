# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission as KML 2.2 of the OGC, its elements in the order of the schema.

Tracks with times are `gx:Track`, Google's extension of KML 2.2.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np

from dsse_ros.picture.theme import DRONE_COLOURS
from dsse_ros.results.report.antimeridian import cut_polygon, cut_track
from dsse_ros.results.report.gis import GisMap, GisMission, GisPoint
from dsse_ros.results.report.swept import Polygon
from dsse_ros.world.scenario.frames import GridFrame
from dsse_ros.world.scenario.geodesy import cell_to_geodetic

MAX_KML_SIDE = 100
"""Cells along the longer side of the largest grid whose cells are in the KML, each as a polygon."""
_SHADES = 10
_NAMESPACES = {
    "xmlns": "http://www.opengis.net/kml/2.2",
    "xmlns:gx": "http://www.google.com/kml/ext/2.2",
}


def kml_text(mission: GisMission) -> str:
    """Return KML with tracks, places and, on small grids, the cells of the last map.

    Cells that have neither POC nor POD are left out. Tracks have times if the scenario has a date.
    In metres there is also the strip that each drone has searched, and in a plan the area that each
    is to search.
    """
    root = ET.Element("kml", _NAMESPACES)
    document = ET.SubElement(root, "Document")
    _text(document, "name", mission.title)
    _add_styles(document, len(mission.tracks))
    folder = _named(document, "Folder", "Tracks")
    for n, (name, points) in enumerate(mission.tracks.items()):
        mark = _named(folder, "Placemark", name)
        _text(mark, "styleUrl", f"#track{n}")
        parts = cut_track(points)
        parent = ET.SubElement(mark, "MultiGeometry") if len(parts) > 1 else mark
        for part in parts:
            _add_line(parent, part)
    for title, what, of_drones in (
        ("Search areas", "area", mission.areas), ("Searched strips", "strip", mission.strips),
    ):  # fmt: skip
        if not of_drones:
            continue
        folder = _named(document, "Folder", title)
        for n, (name, polygons) in enumerate(of_drones.items()):
            mark = _named(folder, "Placemark", f"{what} of {name}")
            _text(mark, "styleUrl", f"#strip{n}")
            _add_polygons(mark, [part for polygon in polygons for part in cut_polygon(polygon)])
    for place in mission.places:
        mark = _named(document, "Placemark", place.name)
        if place.time is not None:
            _text(ET.SubElement(mark, "TimeStamp"), "when", place.time.isoformat())
        _text(ET.SubElement(mark, "Point"), "coordinates", _position(place.lon_deg, place.lat_deg))
    if mission.frame.grid_size.longer <= MAX_KML_SIDE:
        _add_cells(document, mission.frame, mission.maps[-1])
    text = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}'


def _text(parent: ET.Element, tag: str, text: str) -> None:
    ET.SubElement(parent, tag).text = text


def _named(parent: ET.Element, tag: str, name: str) -> ET.Element:
    feature = ET.SubElement(parent, tag)
    _text(feature, "name", name)
    return feature


def _position(*numbers: float) -> str:
    return ",".join(map(repr, numbers))


def _add_styles(document: ET.Element, num_drones: int) -> None:
    """Add the styles of tracks, strips and cells."""
    for n in range(num_drones):
        _add_style(document, f"track{n}", _colour(n, "ff"), width="3")
        _add_style(document, f"strip{n}", _colour(n, "80"), fill=_colour(n, "40"))
    for shade in range(_SHADES + 1):
        fill = f"{220 * shade // _SHADES:02x}0000ff"
        _add_style(document, f"shade{shade}", "40ffffff", fill=fill)


def _add_style(
    document: ET.Element, name: str, line: str, *, width: str = "1", fill: str = ""
) -> None:
    style = ET.SubElement(document, "Style", id=name)
    of_line = ET.SubElement(style, "LineStyle")
    _text(of_line, "color", line)
    _text(of_line, "width", width)
    if fill:
        _text(ET.SubElement(style, "PolyStyle"), "color", fill)


def _colour(drone: int, opacity: str) -> str:
    """Return the colour of a drone in the notation of KML."""
    colour = DRONE_COLOURS[drone % len(DRONE_COLOURS)]
    red, green, blue = (colour[i : i + 2] for i in (1, 3, 5))
    return f"{opacity}{blue}{green}{red}".lower()


def _add_line(parent: ET.Element, points: Sequence[GisPoint]) -> None:
    """Add a track, with times if all of its points have one."""
    times = [point.time.isoformat() for point in points if point.time is not None]
    line = ET.SubElement(parent, "gx:Track" if times else "LineString")
    _text(line, "altitudeMode", "relativeToGround")
    for time in times:
        _text(line, "when", time)
    positions = [(point.lon_deg, point.lat_deg, point.alt_m) for point in points]
    if not times:
        _text(line, "coordinates", " ".join(_position(*position) for position in positions))
        return
    for position in positions:
        _text(line, "gx:coord", " ".join(map(repr, position)))


def _add_polygons(mark: ET.Element, polygons: Sequence[Polygon]) -> None:
    parent = ET.SubElement(mark, "MultiGeometry") if len(polygons) != 1 else mark
    for rings in polygons:
        polygon = ET.SubElement(parent, "Polygon")
        for number, ring in enumerate(rings):
            side = ET.SubElement(polygon, "innerBoundaryIs" if number else "outerBoundaryIs")
            text = " ".join(_position(*vertex) for vertex in ring)
            _text(ET.SubElement(side, "LinearRing"), "coordinates", text)


def _add_cells(document: ET.Element, frame: GridFrame, layer: GisMap) -> None:
    """Add the cells of a map; the more opaque, the more probable."""
    named = "POC" if layer.pod is None else "POC and POD"
    folder = _named(document, "Folder", f"{named} after step {layer.step}")
    values = {"poc": layer.poc} if layer.pod is None else {"poc": layer.poc, "pod": layer.pod}
    rows, cols = np.nonzero(np.sum(list(values.values()), axis=0))
    shades = np.ceil(_SHADES * layer.poc / (float(layer.poc.max()) or 1.0)).astype(int)
    # The edges of cells lie half a cell from the centres.
    rows_at, cols_at = (np.arange(size + 1) - 0.5 for size in frame.grid_size.matrix)
    row, col = np.meshgrid(rows_at, cols_at, indexing="ij")
    lat, lon, _ = cell_to_geodetic(frame, col, row, 0.0)
    for r, c in zip(rows.tolist(), cols.tolist(), strict=True):
        corners = [(r + 1, c), (r + 1, c + 1), (r, c + 1), (r, c), (r + 1, c)]
        outline = [(float(lon[at]), float(lat[at])) for at in corners]
        cell = _named(folder, "Placemark", f"({c}, {r})")
        _text(cell, "styleUrl", f"#shade{shades[r, c]}")
        data = ET.SubElement(cell, "ExtendedData")
        for name, of_cells in values.items():
            _text(ET.SubElement(data, "Data", name=name), "value", repr(float(of_cells[r, c])))
        _add_polygons(cell, cut_polygon((outline,)))

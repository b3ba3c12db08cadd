# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission as KML, by simplekml."""

from __future__ import annotations

import numpy as np
import simplekml

from dsse_ros.report.gis import GisMap, GisMission
from dsse_ros.scenario.frames import GridFrame
from dsse_ros.scenario.geodesy import cell_to_geodetic
from dsse_ros.view.palette import DRONE_COLOURS

MAX_KML_SIDE = 100
"""Cells along the side of the largest grid whose cells are in the KML, each as a polygon."""
_SHADES = 10


def kml_text(mission: GisMission) -> str:
    """Return KML with tracks, places and, on small grids, the cells of the last map.

    Cells that have neither POC nor POD are left out. Tracks have times if the scenario has a date.
    In metres there is also the strip that each drone has searched.
    """
    # The identifiers would go on from those of the last file.
    simplekml.Kml.resetidcounter()
    kml = simplekml.Kml(name=mission.title)
    folder = kml.newfolder(name="Tracks")
    for n, (name, points) in enumerate(mission.tracks.items()):
        coordinates = [(one.lon_deg, one.lat_deg, one.alt_m) for one in points]
        times = [one.time.isoformat() for one in points if one.time is not None]
        if times:
            track = folder.newgxtrack(name=name)
            track.newwhen(times)
            track.newgxcoord(coordinates)
        else:
            track = folder.newlinestring(name=name, coords=coordinates)
        track.altitudemode = simplekml.AltitudeMode.relativetoground
        track.style.linestyle.color = _colour(n, "ff")
        track.style.linestyle.width = 3
    if mission.strips:
        _add_strips(kml, mission)
    for place in mission.places:
        point = kml.newpoint(name=place.name, coords=[(place.lon_deg, place.lat_deg)])
        if place.time is not None:
            point.timestamp.when = place.time.isoformat()
    if mission.frame.grid_size <= MAX_KML_SIDE:
        _add_cells(kml, mission.frame, mission.maps[-1])
    return str(kml.kml(format=False))


def _colour(drone: int, opacity: str) -> str:
    """Return the colour of a drone as KML has it."""
    colour = DRONE_COLOURS[drone % len(DRONE_COLOURS)]
    red, green, blue = (colour[i : i + 2] for i in (1, 3, 5))
    return f"{opacity}{blue}{green}{red}".lower()


def _add_strips(kml: simplekml.Kml, mission: GisMission) -> None:
    """Add the strips that the drones have searched."""
    folder = kml.newfolder(name="Searched strips")
    for n, (name, polygons) in enumerate(mission.strips.items()):
        strip = folder.newmultigeometry(name=f"strip of {name}")
        strip.style.polystyle.color = _colour(n, "40")
        strip.style.linestyle.color = _colour(n, "80")
        for outer, *holes in polygons:
            strip.newpolygon(outerboundaryis=outer, innerboundaryis=holes)


def _add_cells(kml: simplekml.Kml, frame: GridFrame, one: GisMap) -> None:
    """Add the cells of a map; the more opaque, the more probable."""
    named = "POC" if one.pod is None else "POC and POD"
    folder = kml.newfolder(name=f"{named} after step {one.step}")
    styles = [simplekml.Style() for _ in range(_SHADES + 1)]
    for shade, style in enumerate(styles):
        style.polystyle.color = f"{220 * shade // _SHADES:02x}0000ff"
        style.linestyle.color = "40ffffff"
    values = {"poc": one.poc} if one.pod is None else {"poc": one.poc, "pod": one.pod}
    rows, cols = np.nonzero(np.sum(list(values.values()), axis=0))
    shades = np.ceil(_SHADES * one.poc / (float(one.poc.max()) or 1.0)).astype(int)
    # The edges of cells lie half a cell from the centres.
    edges = np.arange(frame.grid_size + 1) - 0.5
    row, col = np.meshgrid(edges, edges, indexing="ij")
    lat, lon, _ = cell_to_geodetic(frame, col, row, 0.0)
    for r, c in zip(rows.tolist(), cols.tolist(), strict=True):
        corners = [(r + 1, c), (r + 1, c + 1), (r, c + 1), (r, c), (r + 1, c)]
        outline = [(float(lon[at]), float(lat[at])) for at in corners]
        cell = folder.newpolygon(name=f"({c}, {r})", outerboundaryis=outline)
        cell.style = styles[shades[r, c]]
        for name, of_cells in values.items():
            cell.extendeddata.newdata(name, repr(float(of_cells[r, c])))

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tracks, places and missions as GPX, by gpxpy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from gpxpy import gpx

from dsse_ros.results.report.antimeridian import cut_track
from dsse_ros.results.report.gis import GisPoint
from dsse_ros.vehicles.mission_items.items import NAV_WAYPOINT, VehicleMission


def gpx_text(
    tracks: Mapping[str, Sequence[GisPoint]] | None = None,
    places: Iterable[GisPoint] = (),
    routes: Mapping[str, VehicleMission] | None = None,
) -> str:
    """Return GPX 1.1 with tracks, places and the waypoints of missions as routes, by name."""
    document = gpx.GPX()
    document.creator = "dsse_ros"
    document.waypoints = [
        gpx.GPXWaypoint(place.lat_deg, place.lon_deg, place.alt_m, place.time, place.name)
        for place in places
    ]
    for name, mission in (routes or {}).items():
        route = gpx.GPXRoute(name)
        route.points = [
            gpx.GPXRoutePoint(item.lat_deg, item.lon_deg, item.alt_m)
            for item in mission.items
            if item.command == NAV_WAYPOINT
        ]
        document.routes.append(route)
    for name, points in (tracks or {}).items():
        track = gpx.GPXTrack(name)
        track.segments = [
            gpx.GPXTrackSegment(
                [
                    gpx.GPXTrackPoint(point.lat_deg, point.lon_deg, point.alt_m, point.time)
                    for point in part
                ]
            )
            for part in cut_track(points)
        ]
        document.tracks.append(track)
    return str(document.to_xml(version="1.1"))

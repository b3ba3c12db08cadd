# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search plan for maps, chart plotters and autopilots, and as a picture."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from dsse_ros.base.whole_files import whole_file
from dsse_ros.picture.mission_view import MissionView
from dsse_ros.picture.rendering import Picture, new_figure
from dsse_ros.picture.theme import LIGHT, drone_colour
from dsse_ros.planners.search_plan.assignments import Assignment
from dsse_ros.results.report.antimeridian import cut_polygon, cut_track
from dsse_ros.results.report.gis import GisMap, GisMission, GisPoint
from dsse_ros.results.report.swept import Polygon
from dsse_ros.results.search_plan.plan import SearchPlan
from dsse_ros.vehicles.autopilots import AUTOPILOTS
from dsse_ros.vehicles.mission_items.items import Home, VehicleMission
from dsse_ros.vehicles.mission_items.track_missions import TrackStyle, track_mission
from dsse_ros.world.scenario.frames import flip_y
from dsse_ros.world.scenario.sea_state import sea_state

LEGS = 4
"""Parts of a step on which a unit of the picture looks or does not."""


def gis_plan(plan: SearchPlan) -> GisMission:
    """Return a plan for GIS files: areas, tracks with times, and commence search points."""
    tracks, areas, places = {}, {}, []
    for assignment in plan.assignments:
        name = assignment.unit.name
        tracks[name] = tuple(_points(plan, assignment))
        areas[name] = (_outline(plan, assignment),)
        csp = tracks[name][1]
        places.append(replace(csp, name=f"CSP {name}"))
    row = _middle_row(plan)
    maps = (GisMap(row - plan.forecast.first_step, plan.forecast.maps[row], None),)
    title = plan.scenario.name or "Search plan"
    return GisMission(title, plan.frame, maps, tracks, tuple(places), {}, areas)


def geojson_text(plan: SearchPlan, mission: GisMission) -> str:
    """Return GeoJSON (RFC 7946) with an area, a track and a commence search point for each unit.

    Args:
        plan: The plan.
        mission: The same for GIS files.
    """
    features: list[dict[str, Any]] = []

    def add(kind: str, coordinates: Any, about: Mapping[str, Any]) -> None:
        geometry = {"type": kind, "coordinates": coordinates}
        features.append({"type": "Feature", "geometry": geometry, "properties": dict(about)})

    for name, assignment, of_area, csp in zip(
        plan.names, plan.assignments, plan.areas, mission.places, strict=True
    ):
        unit, pattern = assignment.unit, assignment.search_pattern
        about = {
            "name": f"{name} {unit.name}", "pattern": pattern.pattern, "heading": pattern.heading,
            "first_turn": pattern.first_turn, "length_m": pattern.length, "width_m": pattern.width,
            "track_spacing_m": pattern.track_spacing, "legs": assignment.choice.lanes,
            "commences": plan.clock(assignment.commences_s), "ends": plan.clock(assignment.ends_s),
            "coverage": assignment.coverage, **of_area._asdict(),
        }  # fmt: skip
        polygons = [part for area in mission.areas[unit.name] for part in cut_polygon(area)]
        add("MultiPolygon", polygons, about)
        lines = [
            [(point.lon_deg, point.lat_deg) for point in part]
            for part in cut_track(mission.tracks[unit.name])
        ]
        add("MultiLineString", lines, {"name": f"track of {unit.name}"})
        add("Point", (csp.lon_deg, csp.lat_deg), {"name": csp.name})
    document = {"type": "FeatureCollection", "features": features}
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def missions_of(plan: SearchPlan, autopilot: str) -> dict[str, VehicleMission]:
    """Return the mission of each unit: take-off at its base, its track, and the return.

    Args:
        plan: The plan.
        autopilot: One of `AUTOPILOTS`.
    """
    missions, cell_m = {}, plan.frame.cell_size_m
    for assignment in plan.assignments:
        unit, spacing = assignment.unit, assignment.choice.spacing_m
        missions[unit.name] = track_mission(
            replace(plan.frame, alt_m=unit.altitude_m, alts_m=()),
            assignment.track / cell_m - 0.5,
            home=Home(*plan.place(*unit.base), 0.0),
            style=TrackStyle(
                acceptance_radius_m=min(10.0, spacing / 2), search_alt_m=0.0,
                speed_mps=unit.speed_mps, airspeed=AUTOPILOTS[autopilot].circles,
            ),
        )  # fmt: skip
    return missions


def plan_view(plan: SearchPlan) -> MissionView:
    """Return the contents of a picture of a plan: its tracks on the map of the middle."""
    scenario, assignments = plan.scenario, plan.assignments
    step_s, cell_m = scenario.step_duration_s, scenario.cell_size
    ends_s = max(each.returns_s if each.unit.returns else each.ends_s for each in assignments)
    steps = int(ends_s // step_s) + 1
    times = np.arange(steps * LEGS + 1, dtype=np.float64) * (step_s / LEGS)
    middles = (times[1:] + times[:-1]) / 2
    row = _middle_row(plan)
    count = len(assignments)
    return MissionView(
        probability=plan.forecast.maps[row],
        tracks=np.array([each.timed_way.places_at(times) / cell_m - 0.5 for each in assignments]),
        alive=np.ones(count, np.bool_), persons=np.empty((0, 2), np.int64),
        found=np.empty(0, np.bool_), datum=None, step=steps, timestep_limit=steps,
        cell_size_m=cell_m, title=scenario.name or "Search plan", pos=plan.pos,
        area=scenario.area_mask, origin=plan.frame.origin, step_s=step_s, legs=LEGS,
        looked=np.array(
            [(middles >= each.commences_s) & (middles < each.ends_s) for each in assignments]
        ),
        strips_m=tuple(each.unit.strip_m for each in assignments),
        sea=sea_state(scenario, row - plan.forecast.first_step)._replace(time=""), ending="planned",
    )  # fmt: skip


def save_plan_picture(plan: SearchPlan, path: Path) -> None:
    """Write the picture of a plan: areas and tracks on the map of the middle of the search.

    Raises:
        OSError: If it cannot be written.
    """
    figure = new_figure()
    Picture(figure).draw(plan_view(plan))
    axes, height_m = figure.axes[0], plan.frame.extent.height
    labels: list[Any] = []
    for number, (name, assignment) in enumerate(zip(plan.names, plan.assignments, strict=True)):
        outline = np.concatenate([assignment.area.corners, assignment.area.corners[:1]])
        x, y = outline[:, 0] / 1000, flip_y(height_m, outline[:, 1]) / 1000
        axes.plot(x, y, color=drone_colour(number), linewidth=1.6, zorder=4.5)
        label = axes.text(
            float(x[:4].mean()), float(y[:4].mean()), name, ha="center", va="center", fontsize=9,
            fontweight="bold", color=LIGHT.ink, zorder=5.6, clip_on=True,
            bbox={"facecolor": LIGHT.paper, "edgecolor": "none", "alpha": 0.75, "pad": 1.5},
        )  # fmt: skip
        _move_apart(label, assignment, height_m, [other.get_window_extent() for other in labels])
        labels.append(label)
    with whole_file(path) as part:
        figure.savefig(part)


def _move_apart(label: Any, assignment: Assignment, height_m: float, others: list[Any]) -> None:
    """Move a label along the long side of its area to where it overlaps no other one, if it can."""
    area = assignment.area
    axis = area.axes[0 if area.along >= area.across else 1]
    long_m = max(area.along, area.across)
    for share in (0.0, 0.2, -0.2, 0.4, -0.4, 0.3, -0.3, 0.5, -0.5):
        east, south = (at + share * long_m * way for at, way in
                       zip((area.east, area.south), axis, strict=True))  # fmt: skip
        label.set_position((east / 1000, flip_y(height_m, south) / 1000))
        box = label.get_window_extent().expanded(1.2, 1.2)
        if not any(box.overlaps(other) for other in others):
            return
    label.set_position((area.east / 1000, flip_y(height_m, area.south) / 1000))


def _middle_row(plan: SearchPlan) -> int:
    """Return the step of the sea in the middle of the searches."""
    begins = min(each.commences_s for each in plan.assignments)
    ends = max(each.ends_s for each in plan.assignments)
    step = int((begins + ends) / 2 / plan.scenario.step_duration_s)
    return plan.forecast.row(plan.forecast.first_step + step)


def _points(plan: SearchPlan, assignment: Assignment) -> list[GisPoint]:
    """Return the way of a unit with the times at its corners."""
    (way, times), unit = assignment.timed_way, assignment.unit
    return [
        GisPoint(
            *plan.place(east, south), unit.altitude_m,
            datetime.fromtimestamp(plan.date_s(time_s), timezone.utc),
        )
        for (east, south), time_s in zip(way.tolist(), times.tolist(), strict=True)
    ]  # fmt: skip


def _outline(plan: SearchPlan, assignment: Assignment) -> Polygon:
    """Return the ring of an area, counterclockwise."""
    places = [plan.place(*corner) for corner in assignment.area.corners.tolist()]
    ring = [(lon, lat) for lat, lon in [*places, places[0]]]
    return (ring,)

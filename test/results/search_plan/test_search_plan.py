# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A plan says the same as text, as GIS files and as missions of vehicles."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import gpxpy
import pytest
import shapely
from PIL import Image

from dsse_ros.planners.search_plan.assignments import Choice, assignment_of
from dsse_ros.planners.search_plan.units_file import UnitFields
from dsse_ros.results.report.gpx import gpx_text
from dsse_ros.results.report.kml import kml_text
from dsse_ros.results.search_plan.action_plan import action_plan, creep_deg, position
from dsse_ros.results.search_plan.plan import SearchPlan, stated_plan
from dsse_ros.results.search_plan.plan_files import (
    geojson_text,
    gis_plan,
    missions_of,
    save_plan_picture,
)
from dsse_ros.search.belief.ensemble_belief import EnsembleForecast
from dsse_ros.vehicles.mission_items.items import NAV_WAYPOINT
from dsse_ros.world.scenario.area import Area
from dsse_ros.world.scenario.place_checks import distance_m
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario

KAYAK = Path(__file__).resolve().parents[3] / "config" / "kayak.yaml"


@pytest.fixture(scope="module")
def plan() -> SearchPlan:
    scenario = Scenario.from_yaml(KAYAK).override(particles=2000, timestep_limit=150)
    assert scenario.incident is not None
    base = scenario.incident.base
    forecast = EnsembleForecast(scenario, profile("flight"))
    units = [
        UnitFields(name="drone", speed=10, endurance=30, altitude=100, sensor="flown_over"),
        UnitFields(name="boat", speed=8, base=[-24.0, -46.33], sweep_width=300, altitude=4),  # type: ignore[arg-type]
    ]
    choices = [
        Choice(2900.0, 2200.0, 20.0, False, 6, 100.0),
        Choice(1000.0, 2300.0, 65.0, True, 4, 240.0),
    ]
    laid = [
        assignment_of(unit.unit(forecast.scenario, base), choice)
        for unit, choice in zip(units, choices, strict=True)
    ]
    return stated_plan(forecast, [each for each in laid if each is not None])


def test_the_text_has_the_parts_of_a_search_action_plan_and_every_unit(plan: SearchPlan) -> None:
    text = action_plan(plan)
    for part in ("1. SITUATION", "2. SEARCH AREAS", "3. EXECUTION", "4. CO-ORDINATION"):
        assert part in text
    assert sum(line.startswith("   A-1 ") for line in text.splitlines()) == 4
    assert f"POS of all units: {plan.pos:.1%}" in text
    assert plan.clock(plan.assignments[0].commences_s) in text
    assert position(*plan.place(*plan.assignments[1].track[0].tolist())) in text
    assert "all searches" not in text
    later = action_plan(replace(plan, pos_before=0.4))
    assert f"POS of all searches: {1 - 0.6 * (1 - plan.pos):.1%}" in later


@pytest.mark.parametrize(
    ("place", "text"),
    [
        ((-24.035, -46.352), "24-02.100S 046-21.120W"),
        ((0.0, 179.9999999), "00-00.000N 180-00.000E"),
        ((59.99999999, -5.5), "60-00.000N 005-30.000W"),
    ],
)
def test_positions_have_degrees_and_minutes(place: tuple[float, float], text: str) -> None:
    assert position(*place) == text


def test_the_legs_creep_to_the_side_of_the_first_turn(plan: SearchPlan) -> None:
    assert [creep_deg(each) for each in plan.assignments] == [110, 335]


def test_pos_is_not_more_than_the_sum_and_not_less_than_the_best(plan: SearchPlan) -> None:
    of_units = [area.pos for area in plan.areas]
    assert max(of_units) < plan.pos <= sum(of_units) + 1e-9
    for area in plan.areas:
        assert 0 < area.poc < 1
        assert 0 < area.pod <= 1
        assert area.poc * area.pod <= area.pos + 0.05


def test_the_areas_of_the_geojson_are_areas_of_a_scenario_and_apart(plan: SearchPlan) -> None:
    document = json.loads(geojson_text(plan, gis_plan(plan)))
    kinds = [feature["geometry"]["type"] for feature in document["features"]]
    assert kinds == ["MultiPolygon", "MultiLineString", "Point"] * 2
    areas = [
        shapely.from_geojson(json.dumps(feature["geometry"]))
        for feature in document["features"][::3]
    ]
    assert areas[0].intersection(areas[1]).area == 0
    for area, line, assignment in zip(
        areas, document["features"][1::3], plan.assignments, strict=True
    ):
        (track,) = line["geometry"]["coordinates"]
        assert area.covers(shapely.LineString(track[1 : 1 + 2 * assignment.choice.lanes]))
    assert len(Area.read(geojson_text(plan, gis_plan(plan))).polygons) == 2


def test_kml_and_gpx_have_every_area_and_track(plan: SearchPlan) -> None:
    mission = gis_plan(plan)
    names = [
        element.text for element in ElementTree.fromstring(kml_text(mission)).iter()
        if element.tag.endswith("name")
    ]  # fmt: skip
    assert {"Search areas", "area of drone", "area of boat", "CSP drone"} <= set(names)
    read = gpxpy.parse(gpx_text(mission.tracks, mission.places, missions_of(plan, "px4")))
    assert [track.name for track in read.tracks] == ["drone", "boat"]
    assert [len(route.points) for route in read.routes] == [12, 8]


def test_a_mission_flies_the_track_from_the_commence_search_point(plan: SearchPlan) -> None:
    for assignment in plan.assignments:
        items = missions_of(plan, "ardupilot")[assignment.unit.name].items
        waypoints = [item for item in items if item.command == NAV_WAYPOINT]
        assert len(waypoints) == 2 * assignment.choice.lanes
        for item, point in zip(waypoints, assignment.track.tolist(), strict=True):
            assert distance_m((item.lat_deg, item.lon_deg), plan.place(*point)) < 0.1
            assert item.alt_m == assignment.unit.altitude_m


def test_the_picture_is_an_image(plan: SearchPlan, tmp_path: Path) -> None:
    save_plan_picture(plan, tmp_path / "plan.png")
    with Image.open(tmp_path / "plan.png") as picture:
        assert picture.size == (800, 600)

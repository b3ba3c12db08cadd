# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a mission of an incident publishes and records besides any other mission."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time

from dsse_ros.mission.files.definition_log import definition_file
from dsse_ros.mission.files.mission_log import MissionLog
from dsse_ros.mission.run import status
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_messages import StepMessages
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.metrics import metrics, work
from dsse_ros.results.report.recomputed import forecast_for, object_shares
from dsse_ros.results.report.report import MissionReport
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.world.scenario.agents import definition_values
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.geodesy import map_to_geodetic
from dsse_ros.world.scenario.rules import profile
from dsse_ros.world.scenario.scenario import Scenario, scenario_frame
from dsse_ros.world.scenario.sea_state import SeaState, sea_state
from msg_adapters.particles import PARTICLE, particles_message
from msg_adapters.point_clouds import points_from_message
from msg_adapters.stamps import header

LAND = {
    "type": "Polygon",
    "coordinates": [[[-45.99, -25], [-45, -25], [-45, -23], [-45.99, -23], [-45.99, -25]]],
}
INCIDENT: dict[str, Any] = {
    "object": "PIW-1",
    "seen": [{"lat": -24.0, "lon": -46.0, "time": "2026-01-17T13:00Z", "radius": 300}],
    "search_start": "2026-01-17T14:00Z",
    "wind": {"from": 270, "speed": 8.0},
    "current": {"toward": 30, "speed": 0.5},
    "shore": LAND,
}


@pytest.fixture(scope="module")
def mission() -> Mission:
    stated = Scenario(incident=INCIDENT, particles=500, timestep_limit=30, grid_size=12)
    mission = Mission(SearchEnv(stated, profile("sea")), 3)
    for _ in range(4):
        mission.command_all([mission.env.rules.action_set.search])
        mission.advance("hold")
    return mission


@pytest.mark.slow
def test_the_particles_are_in_their_cells_with_the_weights_of_the_belief(mission: Mission) -> None:
    found = mission.particles()
    assert found is not None and mission.poc_outside is not None
    positions, weights = found
    assert weights.sum() == pytest.approx(1.0) and weights.std() > 0.0
    s, grid = mission.env.scenario, mission.env.scenario.grid_size
    col, row = np.floor(positions / s.cell_size).astype(int).T
    row = grid.rows - 1 - row
    inside = (col >= 0) & (col < grid.columns) & (row >= 0) & (row < grid.rows)
    assert weights[~inside].sum() == pytest.approx(mission.poc_outside) and not inside.all()
    poc = np.zeros(grid.matrix)
    np.add.at(poc, (row[inside], col[inside]), weights[inside])
    # A particle on the edge of a cell may be rounded into the next one.
    assert np.abs(poc - mission.belief()).sum() < 0.01


def test_the_cloud_has_a_weight_for_each_particle(mission: Mission) -> None:
    frame = scenario_frame(mission.env.scenario)
    found = mission.particles()
    assert found is not None
    points = points_from_message(
        particles_message(header(frame.map_frame, Time()), *found), PARTICLE
    )[0]
    assert np.array_equal(np.stack([points["x"], points["y"]], 1), found[0])
    assert points["weight"].sum() == pytest.approx(1.0, abs=1e-5)


def test_markers_show_wind_current_and_shore(mission: Mission) -> None:
    sea = sea_state(mission.env.scenario, 4)
    assert sea.wind_mps == pytest.approx((8.0, 0.0), abs=1e-5)
    assert sea.current_mps == pytest.approx((0.25, 0.25 * 3**0.5), abs=1e-5)
    frame = scenario_frame(mission.env.scenario)
    message = StepMessages(mission, frame, 1).make("markers", Time())
    by_name = {marker.ns: marker for marker in message.markers}
    start, end = by_name["wind"].points
    assert end.x - start.x == pytest.approx(480.0, abs=1e-3) and end.y == pytest.approx(start.y)
    start, end = by_name["current"].points
    assert np.hypot(end.x - start.x, end.y - start.y) == pytest.approx(300.0, abs=1e-3)
    assert len(by_name["shore"].points) == 5


def test_a_sighting_has_its_place_time_and_circle(mission: Mission) -> None:
    scenario = mission.env.scenario
    sea = sea_state(scenario, 4)
    (seen,) = sea.sightings
    assert seen.label == "LKP 13:00Z" and sea.time.startswith("14:")
    frame = scenario_frame(scenario)
    lat, lon, _ = map_to_geodetic(frame, seen.x_m, seen.y_m, 0.0)
    assert (lat, lon) == (pytest.approx(-24.0, abs=1e-7), pytest.approx(-46.0, abs=1e-7))
    message = StepMessages(mission, frame, 1).make("markers", Time())
    (circle,) = [marker for marker in message.markers if marker.ns == "lkp" and marker.points]
    far = [np.hypot(point.x - seen.x_m, point.y - seen.y_m) for point in circle.points]
    assert far == pytest.approx([300.0] * len(far))
    texts = [marker.text for marker in message.markers if marker.ns == "sea_names"]
    assert texts == [*(flow.label for flow in sea.flows), seen.label]


@pytest.mark.slow
def test_several_sightings_state_their_shares_and_another_day(mission: Mission) -> None:
    before = {"lat": -24.1, "lon": -46.0, "time": "2026-01-16T23:30Z", "weight": 3}
    incident = INCIDENT | {"seen": [before, *INCIDENT["seen"]]}
    stated = Scenario(incident=incident, particles=10, timestep_limit=9, grid_size=12)
    seen = sea_state(stated.resolve(profile("sea")), 0).sightings
    assert [sighting.label for sighting in seen] == [
        "LKP 2026-01-16 23:30Z, 75%",
        "LKP 13:00Z, 25%",
    ]


def test_a_search_without_an_incident_shows_no_sea() -> None:
    assert sea_state(Scenario().resolve(profile("paper")), 0) == SeaState()
    plain = Mission(SearchEnv(Scenario(grid_size=9), profile("paper")), 1)
    assert plain.particles() is None and plain.poc_outside is None


def test_log_diagnostics_and_report_state_what_strands_and_what_is_outside(
    mission: Mission, tmp_path: Path
) -> None:
    scenario = mission.env.scenario
    assert scenario.incident is not None and scenario.incident.grid_summary is not None
    summary = scenario.incident.grid_summary
    assert summary.stranded > 0.1 and summary.inside < 0.95
    log = MissionLog(tmp_path / "mission.csv", scenario_frame(scenario))
    log.write(mission, mission.result)
    log.close()
    text = json.loads(definition_file(tmp_path / "mission.csv").read_text())
    assert (
        text["definition"]["scenario"]["incident"]["grid_summary"]["stranded"] == summary.stranded
    )
    (record,) = read_csv(tmp_path / "mission.csv")
    numbers = metrics(record)
    assert numbers["stranded"] == summary.stranded
    assert numbers["poc_outside"] == 1.0 - summary.inside
    report = MissionReport(record, {}, [record], "mission.csv")
    page = report._page(work(record), (), maps=(), charts=())
    facts = dict(page.facts)
    assert facts["Stranded"] == f"{summary.stranded:.1%}"
    assert facts["POC outside"] == f"{1.0 - summary.inside:.1%}"
    shown = status.values(mission, {}, publishers={}, late=None, lost={}, rejected={})
    assert shown["poc_outside"] == f"{mission.poc_outside:.6f}"
    assert shown["stranded"] == f"{summary.stranded:.6f}"


def test_the_definition_of_an_incident_is_json(mission: Mission) -> None:
    definition = SearchDefinition(mission.env.rules, mission.env.mission_scenario)
    json.dumps(definition_values(definition), allow_nan=False)


@pytest.mark.slow
@pytest.mark.parametrize("rules", ["sea", "flight"])
def test_diagnostics_and_report_state_what_the_object_may_be(rules: str, tmp_path: Path) -> None:
    objects = [
        {"class": "PIW-1", "weight": 2},
        {"class": "LIFE-RAFT-DB-12", "search_object": "raft_4_person"},
    ]
    stated = Scenario(
        incident=INCIDENT | {"object": objects}, particles=2000, timestep_limit=8,
        sensor="sweep_width", weather="poor", visibility=9260, cell_size=400.0, drone_speed=30.0,
        person_pod_multipliers=(0.0,),
    )  # fmt: skip
    mission = Mission(SearchEnv(stated, profile(rules)), 3, belief=True)
    log = MissionLog(
        tmp_path / "mission.csv", scenario_frame(mission.env.scenario), metres=rules == "flight"
    )
    log.write(mission, mission.result)
    shares = [mission.object_shares]
    for _ in range(6):
        if rules == "sea":
            mission.command_all([mission.env.rules.action_set.search])
        mission.advance("hold")
        log.write(mission, mission.result)
        shares.append(mission.object_shares)
    log.close()
    assert shares[0] == pytest.approx({"PIW-1": 2 / 3, "LIFE-RAFT-DB-12": 1 / 3}, abs=1e-3)
    assert sum(shares[-1].values()) == pytest.approx(1.0)
    shown = status.values(mission, {}, publishers={}, late=None, lost={}, rejected={})
    assert shown["object.PIW-1"] == f"{shares[-1]['PIW-1']:.6f}"
    (record,) = read_csv(tmp_path / "mission.csv")
    if rules == "flight":
        record = replace(record, seed=3)
    forecast = forecast_for(record, None)
    assert forecast is not None
    record = replace(record, object_shares=object_shares(record, forecast))
    assert record.object_shares is not None
    assert record.object_shares == pytest.approx(np.array([[*of.values()] for of in shares]))
    MissionReport(record, {}, [record], "mission.csv").write(tmp_path)
    head, *rows = (tmp_path / "objects.csv").read_text().splitlines()
    assert head == "step,time_s,PIW-1,LIFE-RAFT-DB-12" and len(rows) == 7
    assert f"PIW-1 {shares[-1]['PIW-1']:.1%}" in (tmp_path / "report.html").read_text()

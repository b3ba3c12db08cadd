# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions of drones of different kinds: their record, their reports and their altitudes."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.files.mission_log import MissionLog
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_reports import mission_report_of, step_report_of
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.recomputed import follow_belief, forecast_for, mission_views
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.parallel_env import SearchEnv
from dsse_ros.search.step.fault_kernels import STATUSES, UNDER_WAY
from dsse_ros.search.step.viewpoints import viewpoints_at
from dsse_ros.world.scenario.agents import AgentsInfo, agents_from_json, agents_json
from dsse_ros.world.scenario.definition import SearchDefinition
from dsse_ros.world.scenario.frames import map_positions
from dsse_ros.world.scenario.scenario import scenario_frame
from dsse_ros.world.scenario.swarm import Swarm
from dsse_ros.world.searchers.registry import SEARCHERS
from dsse_ros.world.searchers.searcher import Searcher
from msg_adapters.stamps import header, to_stamp
from msg_adapters.step_report import step_report_from_message, step_report_message

ALTITUDES = [120.0, 60.0, 300.0]


@pytest.fixture(autouse=True)
def kinds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SEARCHERS, "low", Searcher(doc="flies low", speed=4.0, altitude=60))
    monkeypatch.setitem(SEARCHERS, "high", Searcher(doc="flies high", altitude=300.0))


def env_of(*searchers: str, **fields: Any) -> SearchEnv:
    return parallel_env(
        grid_size=8, num_drones=3, searchers=searchers, timestep_limit=40, rules="v2",
        probability_of_detection=0.1, **fields,
    )  # fmt: skip


def test_the_record_of_a_mission_says_who_was_under_way_and_gives_its_pictures(
    tmp_path: Path,
) -> None:
    file, mission = tmp_path / "mission.csv", Mission(env_of("drone", "low", "high"), 3)
    log = MissionLog(file, scenario_frame(mission.env.scenario), faults=True)
    log.write(mission, mission.result)
    draw, statuses = np.random.default_rng(1), []
    while not mission.done:
        mission.command_all(draw.integers(0, 9, 3).tolist())
        assert mission.advance("hold").conditions is not None
        statuses.append([STATUSES[k] for k in mission.result.conditions["status"]])
        log.write(mission, mission.result)
    log.close()
    with file.open() as stream:
        rows = [row for row in csv.DictReader(stream) if row["agent"] == "drone1"]
    assert [row["status"] for row in rows[1:]] == [of_step[1] for of_step in statuses]
    under_way = [row for row in rows if row["status"] == "under_way"]
    assert len(under_way) > 10 and {row["action"] for row in under_way} == {""}
    (record,) = read_csv(file)
    views = list(mission_views(record, belief=True))
    assert len(views) == len(rows)


def test_the_record_of_a_mission_that_vehicles_flew_gives_its_pictures(tmp_path: Path) -> None:
    env = env_of("drone", "low", "high", vehicle_timed_actions=True)
    file, mission = tmp_path / "mission.csv", Mission(env, 3)
    log = MissionLog(file, scenario_frame(env.scenario), faults=True, vehicles=True)
    log.write(mission, mission.result)
    draw, works, looks = np.random.default_rng(1), [], []
    while not mission.done:
        mission.command_all(draw.integers(0, 9, 3).tolist())
        works.append(draw.choice(3, 3, p=[0.3, 0.2, 0.5]).astype(np.int8))
        mission.set_work(works[-1])
        looks.append(viewpoints_at(draw.integers(-1, 9, 3), *draw.integers(0, 8, (2, 3))))
        mission.set_viewpoints(looks[-1])
        mission.advance("hold")
        log.write(mission, mission.result)
    log.close()
    (record,) = read_csv(file)
    assert record.work is not None
    np.testing.assert_array_equal(record.work[1:], works)
    assert record.vehicle_viewpoints is not None and mission.pos
    acted = np.where(record.acted[1:], [look["action"] for look in looks], -1)
    np.testing.assert_array_equal(record.vehicle_viewpoints["action"][1:], acted)
    again = list(mission_views(record, belief=True))
    assert len(again) == len(works) + 1 and again[-1].pos == mission.pos
    forecast = forecast_for(record, None)
    assert forecast is not None and record.pos is not None
    assert follow_belief(record, forecast)[0].tolist() == record.pos.tolist()
    text = file.read_text().splitlines()
    file.write_text("\n".join([*text[:2], text[2].replace("done", "tired"), *text[3:]]))
    with pytest.raises(FieldError, match="work must be one of done, coming_back, acting"):
        read_csv(file)


def test_a_step_report_has_status_mask_and_altitude_of_each_kind() -> None:
    mission = Mission(env_of("drone", "low", "high"), 3)
    frame = scenario_frame(mission.env.scenario)
    mission.command_all([1, 1, 1])
    mission.advance("hold")
    message = step_report_message(
        header(frame.map_frame, to_stamp(0)), step_report_of(mission, frame, 7)
    )
    report = step_report_from_message(message)
    assert report["status"].tolist() == [0, UNDER_WAY, 0]
    assert report["action"].tolist() == [1, -1, 1]
    assert np.flatnonzero(report["action_mask"][1]).tolist() == [1]
    assert report["z"].tolist() == ALTITUDES
    whole = mission_report_of(mission, frame, 7)
    assert whole["z"].tolist() == [ALTITUDES] * 2


def test_each_drone_is_shown_at_the_altitude_of_its_kind() -> None:
    scenario = env_of("drone", "low", "high").scenario
    frame, cells = scenario_frame(scenario), [(0, 0), (1, 0), (2, 0)]
    assert [z for _, _, z in map_positions(frame, cells)] == ALTITUDES
    for i, altitude in enumerate(ALTITUDES):
        assert {z for _, _, z in map_positions(frame, cells, i)} == {altitude}
    with pytest.raises(ValueError, match="^drones must be 3, got 2$"):
        map_positions(frame, cells[:2])


def test_the_frame_of_drones_of_one_altitude_is_that_of_the_scenario() -> None:
    frame = scenario_frame(env_of("drone").scenario)
    assert frame.alts_m == () and frame.alt_of(1) == frame.alt_m
    assert frame.altitudes_m(3) == [120.0] * 3


def test_the_topic_agents_lets_a_planner_know_the_kinds() -> None:
    env = env_of("drone", "low", "high")
    scenario, frame = env.scenario, scenario_frame(env.scenario)
    info = AgentsInfo(
        agents=tuple(env.possible_agents), actions=env.rules.actions, rules="v2", seed=1,
        frame=frame, timestep_limit=40, step_duration_s=scenario.step_duration_s,
        mission=1, run_id=1,
        definition=SearchDefinition(env.rules, env.mission_scenario),
    )  # fmt: skip
    read = agents_from_json(agents_json(info))
    assert read.frame == frame
    assert read.definition is not None
    assert read.definition.scenario.searchers == ("drone", "low", "high")
    assert Swarm.of_scenario(read.definition.scenario, read.definition.rules).may_be_under_way

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Missions with faults: their record, their pictures, and which drones are commanded."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from looking import find_in, search_in_vain

from dsse_ros.mission.files.mission_log import MissionLog, columns_of
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_reports import step_report_of
from dsse_ros.mission.vehicles.awaited_vehicles import AwaitedVehicles
from dsse_ros.mission.vehicles.vehicle_tasks import VehicleTasks
from dsse_ros.results.report.logs import read_csv
from dsse_ros.results.report.recomputed import mission_views
from dsse_ros.search.belief.belief import Belief, Forecast
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.search.environments.snapshot import Snapshot
from dsse_ros.search.environments.world_beliefs import DRIFT_SAMPLES
from dsse_ros.search.step.constants import NO_ACTION
from dsse_ros.search.step.fault_kernels import STATUSES
from dsse_ros.world.scenario.scenario import scenario_frame
from msg_adapters.stamps import header, to_stamp
from msg_adapters.step_report import step_report_from_message, step_report_message
from msg_adapters.vehicles import Progress, progress_from_message, vehicle_state_message

FAULTS: dict[str, Any] = {
    "battery_move": 6.0, "relief_steps": 4, "command_delay": 1, "command_drop_rate": 0.1,
    "stuck_rate": 0.05, "position_noise": 0.4, "false_alarm_rate": 0.2, "wind_speed": 2.0,
    "loss_steps": (0, 0, 30),
}  # fmt: skip


def make(**fields: Any) -> Mission:
    defaults: dict[str, Any] = {
        "grid_size": 8, "num_drones": 3, "timestep_limit": 60, "person_amount": 2, "rules": "v2",
        "probability_of_detection": 0.1,
    }  # fmt: skip
    return Mission(parallel_env(**{**defaults, **fields}), 3)


def fly(mission: Mission, log: MissionLog | None, steps: int, seed: int = 1) -> None:
    draw = np.random.default_rng(seed + mission.result.step)
    for _ in range(steps):
        if mission.done:
            break
        mission.command_all(draw.integers(0, 9, 3).tolist())
        mission.advance("hold")
        if log is not None:
            log.write(mission, mission.result)


def logged(path: Path, mission: Mission) -> MissionLog:
    log = MissionLog(path, scenario_frame(mission.env.scenario), faults=True)
    log.write(mission, mission.result)
    return log


def test_the_record_has_what_faults_did_and_gives_the_same_pictures(tmp_path: Path) -> None:
    path, mission = tmp_path / "mission.csv", make(**FAULTS)
    log = logged(path, mission)
    results = [mission.result]
    draw = np.random.default_rng(1)
    while not mission.done:
        mission.command_all(draw.integers(0, 9, 3).tolist())
        results.append(mission.advance("hold"))
        log.write(mission, mission.result)
    log.close()
    assert path.read_text().splitlines()[0] == ",".join(columns_of(covers=False, faults=True))
    (record,), names = read_csv(path), mission.env.rules.actions
    assert record.commands is not None and record.pos is not None
    for of_record, field in ((record.actions, "actions"), (record.commands, "commands")):
        flown = [[names[a] if a != NO_ACTION else "" for a in getattr(r, field)] for r in results]
        assert of_record.tolist() == flown
    assert (record.actions != record.commands).any()
    assert record.pos[-1] == mission.pos
    views = list(mission_views(record, belief=True))
    assert len(views) == len(results)
    assert views[-1].pos == mission.pos


def test_what_the_simulation_knows_of_searches_is_of_the_cells_where_they_were_done(
    tmp_path: Path,
) -> None:
    path = tmp_path / "mission.csv"
    starts = [(4, 4), (5, 4), (4, 3)]
    mission = make(
        position_noise=1.5, command_drop_rate=0.3, person_amount=1, drones_positions=starts,
        person_initial_position=(4, 4), probability_of_detection=0.05,
    )  # fmt: skip
    belief = Belief(Forecast(mission.env.scenario, mission.env.rules, drift_samples=DRIFT_SAMPLES))
    log, draw, elsewhere = logged(path, mission), np.random.default_rng(2), 0
    while mission.result.step < 30 and not mission.done:
        drones, probability = mission.env.world.drones[0], mission.env.probability.copy()
        cells = list(zip(drones["x"].tolist(), drones["y"].tolist(), strict=True))
        elsewhere += int((mission.result.cells != cells).any(axis=1).sum())
        mission.command_all([8 if draw.random() < 0.5 else int(draw.integers(8)) for _ in starts])
        result = mission.advance("hold")
        log.write(mission, result)
        searched = [i for i in range(3) if result.actions[i] == 8]
        expected = [float(probability[y, x]) for x, y in (cells[i] for i in searched)]
        assert result.probabilities[searched].tolist() == expected
        search_in_vain(belief, [cells[i] for i in searched if not result.found[i]])
        for i in searched:
            if result.found[i]:
                find_in(belief, cells[i])
        belief.advance()
        assert mission.pos == pytest.approx(belief.pos, abs=1e-9)
        assert mission.belief() == pytest.approx(belief.poc(), abs=1e-6)
    log.close()
    assert elsewhere > 20


def test_a_mission_resumed_from_its_snapshot_writes_the_same_record(tmp_path: Path) -> None:
    complete, broken = tmp_path / "whole.csv", tmp_path / "broken.csv"
    mission, twin = make(**FAULTS), make(**FAULTS)
    log = logged(complete, mission)
    fly(mission, log, 20)
    snapshot = Snapshot.from_bytes(mission.snapshot().to_bytes())
    broken.write_bytes(complete.read_bytes())
    fly(mission, log, 20)
    log.close()
    twin.restore(snapshot)
    frame = scenario_frame(twin.env.scenario)
    resumed = MissionLog(broken, frame, resume_at=(twin.number, twin.result.step), faults=True)
    resumed.write(twin, twin.result)
    fly(twin, resumed, 20)
    resumed.close()
    assert broken.read_bytes() == complete.read_bytes()


def test_a_drone_that_goes_home_is_commanded_in_vain() -> None:
    mission = make(battery_move=10.0, drones_positions=[(0, 0), (4, 4), (7, 7)])
    for _ in range(7):
        mission.command_all([1, 8, 8])
        result = mission.advance("hold")
    assert result.conditions is not None
    assert STATUSES[result.conditions["status"][0]] == "returning"
    assert mission.missing == [0, 1, 2] and mission.refuse(0) is None
    mission.command_all([1, 8, 8])
    assert mission.advance("hold").cells[0].tolist() == [0, 0]
    assert mission.result.actions[0] == 0 and mission.result.commands[0] == 1


def test_a_report_has_battery_and_status_with_faults_only() -> None:
    for fields, faulty in ((FAULTS, True), ({}, False)):
        mission = make(**fields)
        fly(mission, None, 6)
        frame = scenario_frame(mission.env.scenario)
        report = step_report_of(mission, frame, 1)
        assert ("status" in (report.dtype.names or ())) == faulty
        read = step_report_from_message(
            step_report_message(header(frame.map_frame, to_stamp(1)), report)
        )
        assert read.tobytes() == report.tobytes()
        if faulty and mission.result.conditions is not None:
            assert read["battery"].tolist() == mission.result.conditions["battery"].tolist()
            assert read["status"].tolist() == mission.result.conditions["status"].tolist()
            report["status"][1] = len(STATUSES)
            with pytest.raises(ValueError, match=f"^status must be .* got {len(STATUSES)}$"):
                step_report_from_message(
                    step_report_message(header(frame.map_frame, to_stamp(1)), report)
                )


def test_the_battery_of_a_drone_is_that_of_its_vehicle() -> None:
    mission = make(battery_move=5.0)
    mission.set_battery(1, 0.5)
    mission.set_battery(2, float("nan"))
    fly(mission, None, 1)
    assert mission.result.conditions is not None
    assert mission.result.conditions["battery"].tolist() == [95.0, 45.0, 95.0]
    plain = make()
    plain.set_battery(0, 0.1)
    assert plain.result.conditions is None


def test_a_vehicle_s_report_of_this_mission_sets_the_battery_of_its_drone() -> None:
    mission = make(battery_move=5.0)
    tasks = VehicleTasks(mission)
    for _ in range(2):
        tasks.restart()
    vehicles = AwaitedVehicles(scenario_frame(mission.env.scenario), tasks, mission.set_battery)
    state = {"level": "ok", "message": "", "values": {}}
    for drone, task, share in ((0, 4, 0.25), (1, 2, 0.25), (2, 6, math.nan)):
        reported = Progress(task, battery=share)
        message = vehicle_state_message("it", "", to_stamp(0), reported, **state)  # type: ignore[arg-type]
        vehicles.set_progress(drone, progress_from_message(message, "it"), 7)
    fly(mission, None, 1)
    assert mission.result.conditions is not None
    # That of another mission does not count, nor one that is not known.
    assert mission.result.conditions["battery"].tolist() == [20.0, 95.0, 95.0]


def test_a_lost_drone_is_fallen_and_no_other_mission_is_without_it() -> None:
    mission = make(loss_steps=(1, 2, 2))
    fly(mission, None, 5)
    assert mission.fallen == [0, 1, 2]
    assert mission.done and mission.outcome == "no drone left"
    assert not mission.all_lost

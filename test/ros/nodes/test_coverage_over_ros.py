# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The coverage task over ROS: what the nodes say and write of it is what the environment does."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
from rig import Rig

from dsse_ros.mission.files.mission_log import columns_of
from dsse_ros.planners.registry import planner_for
from dsse_ros.results.report.logs import read_csv
from dsse_ros.search.environments.coverage_task import METRICS
from dsse_ros.search.environments.factories import parallel_env
from msg_adapters.step_report import step_report_from_message

SCENARIO: dict[str, Any] = {
    "rules": "coverage", "num_drones": 3, "probability_of_detection": 0.9, "timestep_limit": 60,
}  # fmt: skip


def test_a_mission_over_ros_is_step_by_step_the_direct_one(rig: Rig, tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    matrix = tmp_path / "matrix.npy"
    np.save(matrix, rng.random((7, 7)) * (rng.random((7, 7)) < 0.5))
    env = parallel_env(**SCENARIO, probability_matrix=matrix)
    policy = planner_for(env, "astar", seed=4)
    observations, infos = env.reset(seed=7)
    direct = []
    while env.agents:
        chosen = policy(observations, infos)
        observations, rewards, _, _, infos = env.step(chosen)
        metrics = [infos["drone0"][name] for name in METRICS]
        direct.append(
            (list(chosen.values()), env.positions.tolist(), list(rewards.values()), metrics)
        )
    record = tmp_path / "mission.csv"
    sim = rig.sim(
        {
            **SCENARIO, "probability_matrix": str(matrix), "seed": 7, "record_file": str(record),
            "qos_overrides./step_report.publisher.history": "keep_all",
        }
    )  # fmt: skip
    # One that looks for persons says why it does not fly, and another one can.
    refused = rig.start("planner_node", {"planner": "belief"})
    line = "with rules coverage, whose task covers cells and has no persons, got 'belief'"
    rig.until(lambda: line in refused.output, "the line")
    assert refused.running and sim.step_number == 0
    refused.stop()
    rig.start("planner_node", {"planner": "astar", "seed": 4})
    rig.until(lambda: not sim.flying, "the end")
    reports = [step_report_from_message(message) for message in sim.reports]
    flown = [
        (
            report["action"].tolist(),
            np.stack([report["col"], report["row"]], axis=1).tolist(),
            report["reward"].tolist(),
            [report[name][0] for name in METRICS],
        )
        for report in reports[1:]
    ]
    assert flown == direct
    assert reports[-1]["all_found"].all() and not reports[0]["all_found"].any()
    rig.until(lambda: "all covered" in sim.process.output, "the line at the end")
    # The log has the same to the last bit.
    rows = list(csv.DictReader(record.read_text(encoding="utf-8").splitlines()))
    assert tuple(rows[0]) == columns_of(covers=True, faults=False) and len(rows) == 3 * (
        len(direct) + 1
    )
    logged = [[float(row[name]) for name in METRICS] for row in rows[3::3]]
    assert logged == [metrics for *_, metrics in direct]
    read = read_csv(record)[-1]
    assert read.coverage_rate is not None and read.coverage_rate[-1] == 1.0
    health = sim.health_when(lambda values: values["coverage_rate"] == "1.000000")
    assert {*METRICS} <= health.keys() and health["state"] == "mission over"


def test_a_belief_of_persons_is_not_published_where_there_are_none(rig: Rig) -> None:
    process = rig.start("sim_node", {"rules": "coverage", "publish_belief": True})
    rig.until(lambda: not process.running, "the end of the node")
    assert process.child.returncode == 2
    assert "publish_belief must be false with rules coverage" in process.output.splitlines()[-1]

# SPDX-License-Identifier: Apache-2.0
"""The coverage task over ROS: what the nodes say and write of it is what the environment does."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rig import Rig, Sim

from dsse_ros.mission.mission_log import COVERAGE_COLUMNS, read_log
from dsse_ros.planners import planner_for
from dsse_ros.search import parallel_env
from dsse_ros.search.coverage import METRICS
from msg_adapters.step_report import step_report_from_message

SCENARIO: dict[str, Any] = {
    "rules": "coverage", "num_drones": 3, "probability_of_detection": 0.9, "timestep_limit": 60,
}  # fmt: skip


@pytest.fixture(scope="module")
def matrix(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A file of what is to be covered."""
    path = tmp_path_factory.mktemp("matrix") / "matrix.npy"
    rng = np.random.default_rng(5)
    np.save(path, rng.random((7, 7)) * (rng.random((7, 7)) < 0.5))
    return str(path)


@pytest.mark.parametrize("planner", ["astar", "sweep"])
def test_a_mission_over_ros_is_step_by_step_the_direct_one(
    rig: Rig, planner: str, matrix: str, tmp_path: Path
) -> None:
    env = parallel_env(**SCENARIO, probability_matrix=matrix)
    policy = planner_for(env, planner, seed=4)
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
    namespace = f"/{planner}"
    process = rig.start(
        "sim_node",
        {
            **SCENARIO, "probability_matrix": matrix, "seed": 7, "record_file": str(record),
            f"qos_overrides.{namespace}/step_report.publisher.history": "keep_all",
        },
        "-r",
        f"__ns:={namespace}",
    )  # fmt: skip
    sim = Sim(rig, process, namespace)
    rig.start("planner_node", {"planner": planner, "seed": 4}, "-r", f"__ns:={namespace}")
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
    assert "all covered" in process.output
    # The log has the same to the last bit.
    rows = list(csv.DictReader(record.open(encoding="utf-8")))
    assert tuple(rows[0]) == COVERAGE_COLUMNS and len(rows) == 3 * (len(direct) + 1)
    logged = [[float(row[name]) for name in METRICS] for row in rows[3::3]]
    assert logged == [metrics for *_, metrics in direct]
    assert read_log(record).coverage["coverage_rate"] == 1.0
    health = sim.health_when(lambda values: values["coverage_rate"] == "1.000000")
    assert {*METRICS} <= health.keys() and health["state"] == "mission over"


def test_what_a_coverage_task_has_no_use_for_is_refused_in_one_line(rig: Rig, matrix: str) -> None:
    for parameters, line in (
        ({"rules": "coverage", "publish_belief": True}, "publish_belief: true is not allowed"),
        ({"rules": "paper", "probability_matrix": matrix}, "probability_matrix: "),
        ({"rules": "coverage", "probability_matrix": matrix + "x"}, "probability_matrix: "),
    ):
        process = rig.start("sim_node", parameters)
        rig.until(lambda: not process.running, "the end of the node")  # noqa: B023
        assert process.child.returncode == 2
        assert line in process.output.splitlines()[-1]


def test_a_planner_for_persons_says_why_it_does_not_fly(rig: Rig, matrix: str) -> None:
    rig.start(
        "sim_node", {**SCENARIO, "probability_matrix": matrix, "seed": 7}, "-r", "__ns:=/persons"
    )
    planner = rig.start("planner_node", {"planner": "belief"}, "-r", "__ns:=/persons")
    rig.until(lambda: "'belief' is not allowed with rules coverage" in planner.output, "the line")
    assert planner.running

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search for a person who follows a Markov chain is the same over ROS as in Python."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from chains import uneven_chain
from rig import Rig

from dsse_ros.planners.registry import planner_for
from dsse_ros.results.report.logs import read_csv
from dsse_ros.search.environments.factories import parallel_env
from msg_adapters.step_report import step_report_from_message

SEARCH: dict[str, Any] = {
    "rules": "paper", "num_drones": 2, "timestep_limit": 25, "probability_of_detection": 0.5,
}  # fmt: skip


def test_planner_and_simulation_know_the_chain_by_its_file(rig: Rig, tmp_path: Path) -> None:
    path = tmp_path / "chain.npy"
    np.save(path, uneven_chain(7))
    env = parallel_env(**SEARCH, person_motion="markov_chain", transition_probabilities=path)
    policy = planner_for(env, "belief", seed=4)
    observations, infos = env.reset(seed=7)
    direct = []
    while env.agents:
        chosen = policy(observations, infos)
        observations, _, _, _, infos = env.step(chosen)
        direct.append((list(chosen.values()), env.positions.tolist()))
    scenario, record = tmp_path / "scenario.yaml", tmp_path / "mission.csv"
    scenario.write_text("transition_probabilities: chain.npy\n")
    sim = rig.sim(
        {
            **SEARCH, "person_motion": "markov_chain", "scenario": str(scenario), "seed": 7,
            "record_file": str(record), "qos_overrides./step_report.publisher.history": "keep_all",
        }
    )  # fmt: skip
    rig.start("planner_node", {"planner": "belief", "seed": 4})
    rig.until(lambda: not sim.flying, "the end")
    reports = [step_report_from_message(message) for message in sim.reports]
    flown = [
        (report["action"].tolist(), np.stack([report["col"], report["row"]], axis=1).tolist())
        for report in reports[1:]
    ]
    assert flown == direct
    rig.until(lambda: record.is_file() and read_csv(record)[-1].complete, "the log")

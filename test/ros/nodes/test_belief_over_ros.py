# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The planners on a belief, over ROS: all that they need is in `agents`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rig import Rig, Sim

from dsse_ros.planners.registry import PERSON_PLANNERS, planner_for
from dsse_ros.search.environments.factories import parallel_env
from msg_adapters.step_report import step_report_from_message

SCENARIO: dict[str, Any] = {
    "rules": "v2",
    "grid_size": 12,
    "num_drones": 3,
    "person_initial_position": [6, 7],
    "vector": [0.4, -0.3],
    "dispersion_inc": 0.05,
    "probability_of_detection": 0.8,
    "pre_search_minutes": 2.0,
    "timestep_limit": 40,
}


def directly(planner: str) -> tuple[list[list[int]], list[list[list[int]]]]:
    """Return the actions of each step of the direct mission, and the cells after it."""
    env = parallel_env(**SCENARIO)
    policy = planner_for(env, planner, seed=4)
    observations, infos = env.reset(seed=7)
    actions, cells = [], []
    while env.agents:
        chosen = policy(observations, infos)
        observations, _, _, _, infos = env.step(chosen)
        observations = {agent: observations[agent] for agent in env.agents}
        actions.append(list(chosen.values()))
        cells.append(env.positions.tolist())
    return actions, cells


@pytest.mark.parametrize("planner", PERSON_PLANNERS)
def test_a_mission_over_ros_is_step_by_step_the_direct_one(rig: Rig, planner: str) -> None:
    # First, so that the nodes find compiled what they need.
    actions, cells = directly(planner)
    process = rig.start(
        "sim_node",
        {
            **SCENARIO,
            "seed": 7,
            f"qos_overrides./{planner}/step_report.publisher.history": "keep_all",
        },
        "-r",
        f"__ns:=/{planner}",
    )
    sim = Sim(rig, process, f"/{planner}")
    rig.start("planner_node", {"planner": planner, "seed": 4}, "-r", f"__ns:=/{planner}")
    rig.until(lambda: not sim.flying, "the end")
    reports = [step_report_from_message(message) for message in sim.reports]
    assert [report["action"].tolist() for report in reports[1:]] == actions
    assert [np.stack([r["col"], r["row"]], axis=1).tolist() for r in reports[1:]] == cells

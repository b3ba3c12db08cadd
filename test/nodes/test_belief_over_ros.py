# SPDX-License-Identifier: Apache-2.0
"""The planners on a belief, over ROS: all that they need is in `agents`."""

from __future__ import annotations

from typing import Any

import pytest
from rig import Rig, Sim

from dsse_ros.planners import BELIEF_PLANNERS, planner_for
from dsse_ros.search import parallel_env
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


@pytest.mark.parametrize("planner", BELIEF_PLANNERS)
def test_a_mission_over_ros_is_step_by_step_the_direct_one(rig: Rig, planner: str) -> None:
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

    env = parallel_env(**SCENARIO)
    direct = planner_for(env, planner, seed=4)
    observations, infos = env.reset(seed=7)
    for report in reports[1:]:
        actions = direct(observations, infos)
        assert report["action"].tolist() == list(actions.values())
        observations, _, _, _, infos = env.step(actions)
        cells = [list(cell) for cell in zip(report["col"], report["row"], strict=True)]
        assert cells == env.positions.tolist()
        observations = {agent: observations[agent] for agent in env.agents}
    assert not env.agents

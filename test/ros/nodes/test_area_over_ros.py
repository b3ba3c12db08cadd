# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A search of a part of the grid over ROS: the bay off Santos, with its shore."""

from __future__ import annotations

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from rig import LATCHED, Rig, Sim
from std_msgs.msg import String

from dsse_ros.mission.files.scenario_files import find_scenario
from dsse_ros.planners.registry import planner_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.agents import agents_from_json
from dsse_ros.world.scenario.frames import cell_to_map
from dsse_ros.world.scenario.scenario import scenario_frame
from msg_adapters.occupancy import occupancy_to_array
from msg_adapters.step_report import step_report_from_message

PLACE = "santos_shore"
FIELDS = {"timestep_limit": 40, "probability_of_detection": 0.0}


@pytest.mark.parametrize("planner", ["greedy", "belief_greedy"])
def test_a_mission_over_ros_is_step_by_step_the_direct_one(rig: Rig, planner: str) -> None:
    process = rig.start(
        "sim_node",
        {
            **FIELDS,
            "scenario": PLACE,
            "seed": 7,
            f"qos_overrides./{planner}/step_report.publisher.history": "keep_all",
        },
        "-r",
        f"__ns:=/{planner}",
    )
    sim = Sim(rig, process, f"/{planner}")
    rig.start("planner_node", {"planner": planner, "seed": 4}, "-r", f"__ns:=/{planner}")
    rig.until(lambda: not sim.flying, "the end")
    env = parallel_env(find_scenario(PLACE), **FIELDS)
    mask = env.scenario.area_mask
    assert mask is not None
    direct = planner_for(env, planner, seed=4)
    observations, infos = env.reset(seed=7)
    for message in sim.reports[1:]:
        report = step_report_from_message(message)
        actions = direct(observations, infos)
        assert report["action"].tolist() == list(actions.values())
        observations, _, _, _, infos = env.step(actions)
        cells = [list(cell) for cell in zip(report["col"], report["row"], strict=True)]
        assert cells == env.positions.tolist()
        assert mask[report["row"], report["col"]].all()
    assert not env.agents


def test_topics_and_commands_know_the_area(rig: Rig) -> None:
    sim = rig.sim({**FIELDS, "scenario": PLACE, "seed": 1}, namespace="/bay")
    scenario = parallel_env(find_scenario(PLACE), **FIELDS).scenario
    mask = scenario.area_mask
    assert mask is not None
    info = agents_from_json(rig.first(String, "/bay/agents").data)
    np.testing.assert_array_equal(info.area_mask, mask)
    assert info.definition is not None and info.definition.scenario == scenario
    grid = rig.first(OccupancyGrid, "/bay/probability_grid", LATCHED)
    np.testing.assert_array_equal(occupancy_to_array(grid) == -1, ~mask)
    # Land lies in the north-east.
    frame, pose = scenario_frame(scenario), PoseStamped()
    pose.header.frame_id = frame.map_frame
    pose.pose.position.x, pose.pose.position.y = cell_to_map(frame, 39, 5)
    sim.talk(PoseStamped, "drone0/command_pose").publish(pose)
    sim.health_after("outside_area")

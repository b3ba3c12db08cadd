# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""`make sim` ends once all messages of the last step are there, in any order."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rig import TIMEOUT_S, free_domain
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import Float64MultiArray

from dsse_ros.cli.run_mission import Watcher
from dsse_ros.mission.run.mission import Mission
from dsse_ros.mission.run.step_reports import step_report_of
from dsse_ros.ros.runtime.qos import COMPLETE
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.frames import GridFrame
from msg_adapters.images import probability_image
from msg_adapters.pos import pos_message
from msg_adapters.stamps import header, to_stamp
from msg_adapters.step_report import step_report_message

FRAME = GridFrame(7, 130.0, -24.04, -46.17, 0.0, 120.0)
RUN = 5
TYPES = {"step_report": PointCloud2, "belief": Image, "probability_of_success": Float64MultiArray}


@pytest.fixture
def over() -> Iterator[dict[str, Any]]:
    """The messages of the last step of a mission, by topic."""
    mission = Mission(parallel_env(grid_size=7, num_drones=2, timestep_limit=1), 0)
    while not mission.done:
        mission.command_all([0, 0])
        mission.advance("hold")
    stamp, step = to_stamp(10**9), mission.result.step
    rclpy.init(args=[], domain_id=free_domain())
    try:
        yield {
            "step_report": step_report_message(
                header(FRAME.map_frame, stamp), step_report_of(mission, FRAME, RUN)
            ),
            "belief": probability_image(header(FRAME.map_frame, stamp), mission.belief()),
            "probability_of_success": pos_message(RUN, mission.number, step, 0.25),
        }
    finally:
        rclpy.shutdown()


@pytest.mark.parametrize("order", itertools.permutations(TYPES))
def test_the_last_line_has_all_of_the_last_step_in_whatever_order_it_comes(
    over: dict[str, Any], order: tuple[str, ...]
) -> None:
    watcher = Watcher(RUN, belief=True, pos=True)
    publishers = {
        topic: watcher.create_publisher(kind, topic, COMPLETE) for topic, kind in TYPES.items()
    }
    executor = SingleThreadedExecutor()
    executor.add_node(watcher)
    # Of another simulation, and of the step before.
    for run_id, step in ((RUN + 1, watcher.step), (RUN, 0)):
        publishers["probability_of_success"].publish(pos_message(run_id, 1, step, 0.125))
    for topic in order:
        assert not watcher.done
        publishers[topic].publish(over[topic])
        for _ in range(10):
            executor.spin_once(timeout_sec=0.05)
    until = time.monotonic() + TIMEOUT_S
    while not watcher.done:
        assert time.monotonic() < until
        executor.spin_once(timeout_sec=0.05)
    assert watcher.line().endswith("over, POS 25.0%")
    watcher.destroy_node()

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A command is for the moment: none of another time reaches a simulation that starts."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import PoseStamped
from rig import LATCHED, TIMEOUT_S, Rig
from std_msgs.msg import Int32MultiArray, String

from dsse_ros.ros.ros_env import DsseRosEnv
from msg_adapters.commands import joint_action_message

MISSION: dict[str, Any] = {"grid_size": 6, "num_drones": 2, "seed": 3}
VOLATILE = {"VOLATILE"}
COMMANDS = {
    "joint_action": Int32MultiArray,
    **{
        f"drone{i}/{name}": kind
        for i in range(2)
        for name, kind in {
            "cmd_action_name": String, "command_pose": PoseStamped,
        }.items()
    },
}  # fmt: skip


def durabilities(infos: list[Any]) -> set[str]:
    return {info.qos_profile.durability.name for info in infos}


def test_a_simulation_that_starts_takes_no_command_of_the_one_before_it(rig: Rig) -> None:
    publishers = {
        name: rig.node.create_publisher(kind, name, LATCHED) for name, kind in COMMANDS.items()
    }
    # As of a simulation that was here before: for the first step of its first mission.
    publishers["joint_action"].publish(joint_action_message(1, 0, [1, 1]))
    for i in range(2):
        publishers[f"drone{i}/cmd_action_name"].publish(String(data="right"))
    sim = rig.sim(MISSION)
    rig.until(lambda: all(p.get_subscription_count() for p in publishers.values()))
    for name in COMMANDS:
        assert durabilities(rig.node.get_subscriptions_info_by_topic(f"/{name}")) == VOLATILE
    # What comes now is taken, after all that could have come before.
    sim.joint(1, 1, step=7)
    health = sim.health_after("stale_step")
    assert health["missing_drones"] == "drone0, drone1" and health["step"] == "0"
    assert len(sim.reports) == 1
    for publisher in publishers.values():
        rig.node.destroy_publisher(publisher)
    sim.process.stop()


def test_who_commands_does_not_latch_it(rig: Rig) -> None:
    sim = rig.sim({**MISSION, "auto_reset": False}, namespace="/volatile")
    planner = rig.start("planner_node", {"planner": "sweep"}, "-r", "__ns:=/volatile")

    def offered() -> set[str]:
        return durabilities(rig.node.get_publishers_info_by_topic("/volatile/joint_action"))

    rig.until(lambda: len(sim.reports) > 2, "steps that the planner commands")
    rig.until(offered, "its publisher")
    assert offered() == VOLATILE
    planner.stop()
    rig.until(lambda: not offered(), "the planner to end")
    env = DsseRosEnv("/volatile", timeout_s=TIMEOUT_S, domain_id=rig.domain)
    try:
        rig.until(offered, "the environment")
        assert offered() == VOLATILE
    finally:
        env.close()
    sim.process.stop()

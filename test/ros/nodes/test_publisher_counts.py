# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""More than one simulation or planner on the same topics, and each on its own."""

from __future__ import annotations

import contextlib
import json
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rig import ALL, BEST_EFFORT, Rig, Sim, content, stamp_ns
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import NavSatFix
from std_msgs.msg import Int32MultiArray, String

from msg_adapters.commands import joint_action_message

ENDLESS: dict[str, Any] = {
    "num_drones": 2,
    "probability_of_detection": 0.0,
    "timestep_limit": 10**6,
    "step_rate": 50.0,
    "seed": 0,
}


@pytest.fixture(autouse=True)
def ended(rig: Rig) -> Iterator[None]:
    """Stop after each test what it has started: these missions would go on to the last one."""
    before = len(rig.processes)
    yield
    for process in rig.processes[before:]:
        process.signal(signal.SIGINT)
        assert process.wait() == 0, process.output


def goes_on(rig: Rig, sim: Sim, steps: int = 3) -> None:
    before = sim.step_number
    rig.until(lambda: sim.step_number >= before + steps, "further steps")


def test_a_second_planner_is_noticed_and_the_mission_goes_on(rig: Rig) -> None:
    sim = rig.sim(ENDLESS, namespace="/two_planners")
    first = rig.start("planner_node", {"planner": "sweep"}, "-r", "__ns:=/two_planners")
    goes_on(rig, sim)
    assert "nodes publish" not in sim.process.output
    second = rig.start("planner_node", {"planner": "random"}, "-r", "__ns:=/two_planners")
    health = sim.health_when(lambda values: values["publishers.joint_action"] == "2")
    assert health["level"] == DiagnosticStatus.WARN
    goes_on(rig, sim)
    assert sim.process.output.count("2 nodes publish joint_action") == 1
    rig.until(lambda: "is ready" in second.output, "the second planner to be ready")
    second.stop()
    sim.health_when(lambda values: values["publishers.joint_action"] == "1")
    goes_on(rig, sim)
    first.stop()


def test_a_second_simulation_on_the_same_topics_is_noticed(rig: Rig) -> None:
    sim = rig.sim(ENDLESS, namespace="/two_sims")
    other = rig.start("sim_node", ENDLESS, "-r", "__ns:=/two_sims")
    health = sim.health_when(lambda values: values["publishers.step_report"] == "2")
    assert health["level"] == DiagnosticStatus.WARN
    rig.until(lambda: "2 nodes publish step_report" in sim.process.output, "a warning")
    # From then on an interrupt ends it in peace.
    rig.until(lambda: "waiting for commands" in other.output, "what it waits for")
    other.stop()


def test_a_simulation_that_waits_says_again_and_again_whether_somebody_could_command(
    rig: Rig,
) -> None:
    sim = rig.sim(ENDLESS | {"num_drones": 1, "publish_clock": False}, namespace="/hasty")
    nobody = "no publisher on joint_action or drone0/cmd_action_name"
    rig.until(lambda: nobody in sim.process.output, "the first reason")
    # As of a planner whose first command was lost before it was discovered.
    command = rig.node.create_publisher(String, "/hasty/drone0/cmd_action_name", 10)
    missed = (
        "step 0: waiting for commands of drone0: a publisher on drone0/cmd_action_name, but no "
        "command for step 0 since it was discovered"
    )
    rig.until(lambda: missed in sim.process.output, "the second reason")
    rig.node.destroy_publisher(command)
    sim.fly(1)
    sim.process.stop()


def test_a_second_clock_is_noticed_by_each_that_publishes_one(rig: Rig) -> None:
    one = rig.sim(ENDLESS, "-r", "/clock:=/ours/clock", namespace="/one_clock")
    one.health_when(lambda values: values["publishers./clock"] == "1")
    other = rig.sim(ENDLESS, "-r", "/clock:=/ours/clock", namespace="/two_clocks")
    for sim in (one, other):
        health = sim.health_when(lambda values: values["publishers./clock"] == "2")
        assert health["level"] == DiagnosticStatus.WARN
        assert "2 nodes publish /clock" in health["message"]
    other.process.stop()
    one.health_when(lambda values: values["publishers./clock"] == "1")


def test_without_publish_clock_there_is_no_clock_and_no_second_one_to_notice(rig: Rig) -> None:
    remap = ("-r", "/clock:=/nobodys/clock")
    sim = rig.sim(ENDLESS | {"publish_clock": False}, *remap, namespace="/no_clock")
    assert "publishers./clock" not in sim.health()
    assert rig.node.get_publishers_info_by_topic("/nobodys/clock") == []
    sim.fly(1, 1)
    # The stamps are of the node's own clock, and diagnostics of the wall's in any case.
    assert abs(stamp_ns(sim.reports.last) / 1e9 - time.time()) < 60


def test_the_names_of_all_frames_begin_with_the_prefix(rig: Rig) -> None:
    sim = rig.sim(ENDLESS | {"frame_prefix": "a/", "map_frame": "sea"}, namespace="/prefixed")
    odom = rig.listen(Odometry, "/prefixed/drone1/odom")
    fixes = rig.listen(NavSatFix, "/prefixed/drone1/fix", BEST_EFFORT)
    rig.until(lambda: sim.fly(1, 1) is not None and odom and fixes, "odometry and fixes")
    assert (odom.last.header.frame_id, odom.last.child_frame_id) == ("a/sea", "a/drone1/base_link")
    assert fixes.last.header.frame_id == "a/drone1/base_link"
    assert sim.reports.last.header.frame_id == "a/sea"
    assert rig.first(PoseStamped, "/prefixed/drone0/pose").header.frame_id == "a/sea"
    published = json.loads(rig.first(String, "/prefixed/agents").data)
    assert (published["map_frame"], published["frame_prefix"]) == ("a/sea", "a/")
    pose = PoseStamped()
    for frame in ("sea", "a/sea"):
        pose.header.frame_id = frame
        pose.pose.position.x = pose.pose.position.y = 65.0
        sim.talk(PoseStamped, "drone0/command_pose").publish(pose)
    sim.wait_until_quiet()
    health = sim.health_after("foreign_frame")
    assert health["missing_drones"] == "drone1"


def test_missions_in_namespaces_of_their_own_do_not_reach_each_other(rig: Rig) -> None:
    names = ("north", "south")
    clocks = {
        name: rig.start(
            "sim_node", ENDLESS | {"step_rate": 0.0}, "-r", f"__ns:=/{name}",
            "-r", f"/clock:=/{name}/clock",
        )
        for name in names
    }  # fmt: skip
    north, south = (Sim(rig, clocks[name], f"/{name}") for name in names)
    north.fly(1, 1)
    assert (north.step_number, south.step_number) == (1, 0)
    received = rig.listen(Clock, "/north/clock")
    north.fly(1, 1)
    rig.until(lambda: received, "the clock of the one")
    on_the_common_one = rig.node.get_publishers_info_by_topic("/clock")
    assert not {info.node_namespace for info in on_the_common_one} & {"/north", "/south"}


def test_names_can_be_remapped_and_their_qos_overridden_under_the_new_name(rig: Rig) -> None:
    sim = Sim(
        rig,
        rig.start(
            "sim_node",
            {
                **ENDLESS,
                "num_drones": 1,
                "qos_overrides./fleet/orders.subscription.depth": 50,
                "qos_overrides./remapped/step_report.publisher.history": "keep_all",
            },
            "-r", "joint_action:=/fleet/orders",
            "-r", "drone0/pose:=/uav1/pose",
            "-r", "__ns:=/remapped",
        ),
        "/remapped",
    )  # fmt: skip
    orders = rig.talk(Int32MultiArray, "/fleet/orders")
    orders.publish(joint_action_message(1, 0, [1]))
    rig.until(lambda: sim.step_number == 1, "a step")
    assert rig.first(PoseStamped, "/uav1/pose").pose.position.x == 1.5 * 130.0
    with rig.listening(type(sim.reports.last), "/remapped/step_report", ALL) as late:
        rig.until(lambda: len(late) == 2, "the report of every step")
        assert [content(m) for m in late] == [content(m) for m in sim.reports]


def test_a_node_can_have_another_name(rig: Rig) -> None:
    process = rig.start("sim_node", ENDLESS, "-r", "__ns:=/named", "-r", "__node:=ocean")
    Sim(rig, process, "/named")
    known = rig.node.get_node_names_and_namespaces
    rig.until(lambda: ("ocean", "/named") in known(), "the node's name")


@pytest.mark.parametrize("use_sim_time", [False, True])
def test_a_planner_that_comes_late_takes_over_whatever_its_clock(
    tmp_path: Path, use_sim_time: bool
) -> None:
    # In a domain of its own: simulations of other tests have clocks too.
    with contextlib.closing(Rig(tmp_path)) as rig:
        sim = rig.sim(ENDLESS)
        sim.fly(1, 3)
        for _ in range(2):
            planner = rig.start("planner_node", {"use_sim_time": use_sim_time, "planner": "sweep"})
            goes_on(rig, sim)
            planner.kill()


def test_a_mission_is_paused_stepped_and_reset_while_a_planner_commands_it(rig: Rig) -> None:
    sim = rig.sim(ENDLESS, namespace="/held")
    rig.start("planner_node", {"planner": "sweep"}, "-r", "__ns:=/held")
    goes_on(rig, sim)
    sim.pause(True)
    # One a call, and none by itself.
    first, second = (sim.trigger("step") for _ in range(2))
    held = int(first[1].removeprefix("step "))
    assert (first, second) == ((True, f"step {held}"), (True, f"step {held + 1}"))
    rig.until(lambda: sim.step_number == held + 1, "the step")
    assert sim.trigger("reset")[0]
    rig.until(lambda: sim.step_number == 0, "the new mission")
    sim.health()
    assert sim.step_number == 0
    sim.pause(False)
    goes_on(rig, sim)
    agents = rig.first(String, "/held/agents")
    assert json.loads(agents.data)["mission"] == 2


def test_with_a_hundred_drones_every_one_is_published(rig: Rig, tmp_path: Path) -> None:
    parameters = ENDLESS | {"num_drones": 100, "grid_size": 40, "record_file": f"{tmp_path}/x.csv"}
    sim = rig.sim(parameters, namespace="/hundred")
    rig.start("planner_node", {"planner": "sweep"}, "-r", "__ns:=/hundred")
    goes_on(rig, sim, 20)
    assert len(sim.report) == 100
    assert rig.first(PoseStamped, "/hundred/drone99/pose").header.frame_id == "map"
    assert sim.trigger("reset")[0]

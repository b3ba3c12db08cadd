# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Searches in metres over ROS: commands, steps, poses, refusals and restarts."""

from __future__ import annotations

import itertools
import math
import random
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Odometry, Path
from numpy.typing import NDArray
from rig import LATCHED, Rig, Sim
from std_msgs.msg import Float64MultiArray, String

from dsse_ros.planners.play import play
from dsse_ros.planners.registry import planner_for
from dsse_ros.search.environments.factories import parallel_env
from dsse_ros.world.scenario.agents import agents_from_json
from msg_adapters.commands import joint_command_message
from msg_adapters.step_report import path_of, step_report_from_message

FIELDS: dict[str, Any] = {
    "person_motion": "constant_drift", "grid_size": 20, "particles": 500, "sigma": 3.0,
    "wind_speed": 4.0, "wind_toward": 30.0, "probability_of_detection": 0.5,
}  # fmt: skip
CELLS = ((9, 9), (10, 10), (3, 3))
SIM = FIELDS | {
    "rules.profile": "flight",
    "seed": 5,
    "drones_positions": [part for cell in CELLS for part in cell],
}
NOBODY = {"probability_of_detection": 0.0}


def command(
    sim: Sim, *actions: tuple[float, float], mission: int | None = None, step: int | None = None
) -> None:
    mission = sim.search[1] if mission is None else mission
    step = sim.step_number if step is None else step
    talker = sim.talk(Float64MultiArray, "joint_command")
    talker.publish(joint_command_message(mission, step, actions))


def fly(sim: Sim, *actions: tuple[float, float]) -> NDArray[Any]:
    seen = len(sim.reports)
    command(sim, *actions)
    return sim.next_report(seen)


def pose(x: float, y: float) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = "map"
    message.pose.position.x, message.pose.position.y = x, y
    return message


def velocity(sim: Sim, drone: int, forward: float, yaw_rate: float, **more: float) -> None:
    message = TwistStamped()
    message.twist.linear.x, message.twist.angular.z = forward, yaw_rate
    for name, value in more.items():
        part, axis = name.split("_")
        setattr(getattr(message.twist, part), axis, value)
    sim.talk(TwistStamped, f"drone{drone}/cmd_vel").publish(message)


@pytest.fixture(scope="module")
def sim(rig: Rig) -> Sim:
    return rig.sim(SIM | NOBODY | {"timestep_limit": 1000})


def test_a_mission_over_ros_is_step_by_step_the_direct_one(rig: Rig) -> None:
    node, draw = rig.sim(SIM, namespace="/direct"), random.Random(1)
    env = parallel_env(rules="flight", drones_positions=CELLS, **FIELDS)
    env.reset(seed=5)
    for _ in range(12):
        if not env.agents:
            break
        joint = [(draw.uniform(-1, 1), draw.uniform(-1, 1)) for _ in CELLS]
        _, rewards, _, _, infos = env.step(
            {agent: np.array(joint[int(agent[5:])]) for agent in env.agents}
        )
        report = fly(node, *joint)
        for agent, info in infos.items():
            i = int(agent[5:])
            assert path_of(report)[i].tobytes() == info["path"].tobytes()
            assert report["reward"][i] == rewards[agent]
            assert (report["turn_action"][i], report["speed_action"][i]) == joint[i]
    assert node.step_number > 3
    info = agents_from_json(rig.first(String, "/direct/agents").data)
    assert info.actions == () and info.definition is not None


def test_velocities_in_any_order_are_one_step_of_their_turns_and_speeds(sim: Sim) -> None:
    for order in itertools.permutations(range(3)):
        before = sim.report["heading"].copy()
        seen = len(sim.reports)
        for drone in order:
            velocity(sim, drone, (4.0, 8.0, 99.0)[drone], (0.0, 0.05, -0.1)[drone])
        report = sim.next_report(seen)
        assert report["airspeed"].tolist() == pytest.approx([4.0, 8.0, 10.0])
        turned = np.remainder(report["heading"] - before + math.pi, 2 * math.pi) - math.pi
        # To the left is against the clock; a step is 13 s.
        assert turned.tolist() == pytest.approx([0.0, -0.65, 1.3], abs=1e-9)


def test_pose_odometry_and_path_have_the_exact_position_and_heading(sim: Sim) -> None:
    rig = sim.rig
    with rig.listening(Odometry, "drone1/odom") as odoms, rig.listening(Path, "drone1/path"):
        rig.until(lambda: rig.node.count_subscribers("/drone1/odom"))
        report = fly(sim, *[(0.25, 0.5)] * 3)
        pose = rig.first(PoseStamped, "drone1/pose")
        x, south = path_of(report)[1, -1].tolist()
        yaw = math.pi / 2 - report["heading"][1]
        for of in (pose.pose, rig.until(lambda: odoms and odoms.last.pose.pose)):
            assert (of.position.x, of.position.y) == pytest.approx((x, 2600.0 - south))
            assert 2 * math.atan2(of.orientation.z, of.orientation.w) == pytest.approx(
                math.remainder(yaw, 2 * math.pi)
            )
        # Airspeed in the body frame, and the wind.
        linear = odoms.last.twist.twist.linear
        toward = math.pi / 2 - math.radians(30.0) - yaw
        assert (linear.x, linear.y) == pytest.approx(
            (report["airspeed"][1] + 4 * math.cos(toward), 4 * math.sin(toward))
        )
        track = rig.first(Path, "drone1/path")
        rig.until(lambda: len(rig.first(Path, "drone1/path").poses) > 1)
        assert track.header.frame_id == "map"


def test_what_is_no_command_is_refused_in_one_line_with_nothing_changed(sim: Sim) -> None:
    before, seen = sim.step_number, len(sim.process.output.splitlines())
    sim.health()
    talker, mission = sim.talk(Float64MultiArray, "joint_command"), sim.search[1]
    for data, code in (
        ([mission, before, *[0.0] * 5], "wrong_size"),
        ([mission + 1, before, *[0.0] * 6], "stale_mission"),
        ([mission, before + 1, *[0.0] * 6], "stale_step"),
        ([math.nan, before, *[0.0] * 6], "stale_mission"),
        ([mission, before, *[0.0] * 5, math.nan], "out_of_range"),
        ([mission, before, 1.5, *[0.0] * 5], "out_of_range"),
    ):
        talker.publish(Float64MultiArray(data=[float(number) for number in data]))
        sim.health_after(code)
    for values, code in (
        ({"forward": math.nan, "yaw_rate": 0.0}, "not_finite"),
        ({"forward": 5.0, "yaw_rate": math.inf}, "not_finite"),
        ({"forward": 5.0, "yaw_rate": 0.0, "linear_y": 1.0}, "not_forward"),
        ({"forward": 5.0, "yaw_rate": 0.0, "angular_x": 1.0}, "not_forward"),
    ):
        velocity(sim, 0, **values)
        sim.health_after(code)
    foreign = TwistStamped()
    foreign.header.frame_id = "map"
    sim.talk(TwistStamped, "drone0/cmd_vel").publish(foreign)
    sim.health_after("foreign_frame")
    sim.talk(Path, "drone0/command_path").publish(Path())
    sim.health_after("wrong_size")
    sim.talk(PoseStamped, "drone0/command_pose").publish(pose(math.nan, 5.0))
    sim.health_after("not_finite")
    assert sim.health()["missing_drones"] == "drone0, drone1, drone2"
    assert sim.step_number == before
    lines = sim.process.output.splitlines()[seen:]
    assert any(
        "data must be mission, step and 3 turns and speeds, got 7 numbers" in o for o in lines
    )
    assert any("twist.linear.x must be a finite number, got nan" in line for line in lines)


def test_drones_fly_poses_and_paths_and_state_what_is_left(rig: Rig) -> None:
    node = rig.sim(SIM | NOBODY | {"wind_speed": 0.0}, namespace="/tracks")
    with rig.listening(Path, "/tracks/drone1/remaining_path", LATCHED) as left:
        velocity(node, 0, 10.0, 0.0)
        node.talk(PoseStamped, "drone2/command_pose").publish(pose(455.0, 1500.0))
        track = Path(poses=[pose(1365.0, 1500.0), pose(1600.0, 1500.0)])
        # The poses of a path may leave their frame to it.
        track.header.frame_id, track.poses[0].header.frame_id = "map", ""
        node.talk(Path, "drone1/command_path").publish(track)
        rig.until(lambda: node.step_number == 1)
        rig.until(lambda: left and len(left.last.poses) == 3)
        assert left.last.poses[-1].pose.position.x == 1600.0
        for _ in range(20):
            if node.health()["missing_drones"] != "drone0":
                break
            seen = len(node.reports)
            velocity(node, 0, 10.0, 0.0)
            node.next_report(seen)
        rig.until(lambda: not left.last.poses)
    x, y = node.report["x"][1], node.report["y"][1]
    assert math.dist((x, y), (1600.0, 1500.0)) <= 10.0
    track = rig.first(Path, "/tracks/drone1/path")
    rig.until(lambda: len(rig.first(Path, "/tracks/drone1/path").poses) > 3)


def test_a_planner_over_ros_flies_as_it_flies_directly(rig: Rig) -> None:
    fields = FIELDS | {"timestep_limit": 30}
    env = parallel_env(rules="flight", drones_positions=CELLS, **fields)
    direct = [
        [step.actions[agent].tolist() for agent in env.possible_agents if agent in step.actions]
        for step in play(env, planner_for(env, "greedy", seed=2), seed=5)
    ]
    node = rig.sim(SIM | {"timestep_limit": 30}, namespace="/planned")
    rig.start("planner_node", {"planner": "greedy", "seed": 2}, "-r", "__ns:=/planned")
    rig.until(lambda: not node.flying)
    reports = [step_report_from_message(message) for message in node.reports]
    flown = [
        np.stack([report["turn_action"], report["speed_action"]], axis=1).tolist()
        for report in reports[1:]
    ]
    assert flown == direct


def test_the_plan_over_ros_is_that_of_the_planner(rig: Rig) -> None:
    env = parallel_env(rules="flight", drones_positions=CELLS, **FIELDS)
    options = {"samples": 200, "horizon": 5, "width": 4}
    planner = planner_for(env, "belief", seed=2, **options)
    planner(*env.reset(seed=5))
    node = rig.sim(SIM | {"step_mode": "manual", "step_rate": 0.0}, namespace="/stated")
    rig.start(
        "planner_node",
        {"planner": "belief", "seed": 2,
         "planner_options": [f"{name}={value}" for name, value in options.items()]},
        "-r", "__ns:=/stated",
    )  # fmt: skip
    for drone, plan in enumerate(planner.plans().values()):
        stated = rig.first(Path, f"/stated/drone{drone}/plan")
        assert stated.header.stamp == node.reports.last.header.stamp
        points = [(pose.pose.position.x, pose.pose.position.y) for pose in stated.poses]
        x, y = node.report["x"][drone], node.report["y"][drone]
        assert points[0] == pytest.approx((x, y))
        expected = (plan + 0.5) * 130.0 * (1, -1) + (0.0, 2600.0)
        assert np.array(points[1:]) == pytest.approx(expected, abs=1e-6)


def test_a_killed_node_goes_on_where_it_was(rig: Rig) -> None:
    fields = SIM | NOBODY | {
        "snapshot_file": str(rig.folder / "flight.snapshot"), "snapshot_every": 1,
        "record_file": str(rig.folder / "flight.csv"), "run_id": 7,
    }  # fmt: skip
    joints = [((0.1 * k, 0.5),) * 3 for k in range(-4, 5)]
    unbroken = rig.sim(SIM | NOBODY | {"run_id": 7}, namespace="/whole")
    node = rig.sim(fields, namespace="/killed")
    of_whole = [unbroken.report, *(fly(unbroken, *joint) for joint in joints)]
    for joint in joints[:4]:
        fly(node, *joint)
    node.process.kill()
    again = rig.sim(fields | {"resume": True}, namespace="/killed")
    # It may have been killed before it saved the last step.
    assert again.step_number in (3, 4)
    assert again.report.tobytes() == of_whole[again.step_number].tobytes()
    for step in range(again.step_number, len(joints)):
        assert fly(again, *joints[step]).tobytes() == of_whole[step + 1].tobytes()


def test_in_real_time_drones_without_commands_fly_straight_on(rig: Rig) -> None:
    times = {"step_mode": "realtime", "step_rate": 0.5, "odom_rate": 50.0}
    with rig.listening(Odometry, "/realtime/drone0/odom") as odoms:
        node = rig.sim(SIM | NOBODY | times, namespace="/realtime")
        rig.until(lambda: node.step_number > 0)
        # On the way from step to step, long before it stops at the edge of the grid.
        rig.until(lambda: len({odom.pose.pose.position.y for odom in odoms}) > 10)
    report = node.report
    assert report["turn_action"].tolist() == [0.0] * 3
    assert report["speed_action"].tolist() == [1.0] * 3 and not report["held"].any()

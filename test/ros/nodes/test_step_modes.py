# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission in real time and one that steps by hand, and the way from one to the other."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rig import Inbox, Rig, Sim, stamp_ns
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from dsse_ros.world.scenario.agents import agents_from_json
from dsse_ros.world.scenario.frames import map_positions
from msg_adapters.poses import pose_stamped
from msg_adapters.stamps import header, to_stamp
from msg_adapters.step_report import step_report_from_message

LEFT, RIGHT, UP, DOWN, SEARCH = range(5)
NO_ACTION = -1
STEP_NS = 13 * 10**9
CELL_M, SPEED_MPS = 130.0, 10.0
DEFAULTS = {
    "step_mode": "realtime", "step_rate": 5.0, "real_time_factor": 1.0, "missing_action": "search",
}  # fmt: skip


@pytest.fixture(scope="module")
def node(rig: Rig) -> Sim:
    return rig.sim(
        {
            **DEFAULTS,
            "grid_size": 20,
            "drones_positions": [0, 10],
            "person_initial_position": [19, 0],
            "vector": [0.0, 0.0],
            "probability_of_detection": 0.0,
            "timestep_limit": 100000,
            "odom_rate": 100.0,
            "seed": 1,
        }
    )


@pytest.fixture
def clock(node: Sim) -> Iterator[Inbox]:
    """All of /clock during a test, which never runs backwards."""
    node.pause(False)
    node.set(**DEFAULTS)
    with node.rig.listening(Clock, "/clock") as inbox:
        node.rig.until(lambda: inbox)
        yield inbox
        times = times_of(inbox)
        assert (np.diff(times) >= 0).all(), np.diff(times).min()


@pytest.fixture
def sim(node: Sim, clock: Inbox) -> Iterator[Sim]:
    node.reset()
    yield node


def times_of(clock: Inbox) -> list[int]:
    return [m.clock.sec * 10**9 + m.clock.nanosec for m in clock]


def go_east(sim: Sim) -> None:
    frame = agents_from_json(sim.rig.first(String, "agents").data).frame
    goal = pose_stamped(header(frame.map_frame, to_stamp(0)), *map_positions(frame, [(19, 10)], 0))
    sim.talk(PoseStamped, "drone0/command_pose").publish(goal)


def test_real_time_waits_for_nobody(sim: Sim) -> None:
    seen = len(sim.reports)
    assert sim.next_report(seen)["action"].tolist() == [SEARCH]
    sim.set(missing_action="hold")
    report = sim.next_report(len(sim.reports))
    assert report["action"].tolist() == [NO_ACTION] and report["held"].tolist() == [1]


def test_odometry_flies_from_cell_to_cell_at_the_speed_of_the_drone(sim: Sim) -> None:
    def between_cells(message: Odometry) -> bool:
        return 0.1 < (message.pose.pose.position.x / CELL_M - 0.5) % 1.0 < 0.9

    with sim.rig.listening(Odometry, "/drone0/odom") as odom:
        sim.rig.until(lambda: odom)
        go_east(sim)
        sim.rig.until(lambda: odom.last.pose.pose.position.x > 4.5 * CELL_M)
        # Not only where the drone is at the steps.
        sim.rig.until(lambda: sum(map(between_cells, odom)) > 4, "odometry between the cells")
        messages = list(odom)
    x = np.array([m.pose.pose.position.x for m in messages])
    speed = np.array([m.twist.twist.linear.x for m in messages])
    seconds = np.array([stamp_ns(m) for m in messages]) / 1e9
    assert (np.diff(x) >= 0).all() and (np.diff(seconds) >= 0).all()
    assert set(speed) == {0.0, SPEED_MPS}
    flying = x > 0.5 * CELL_M
    start = seconds[flying] - x[flying] / SPEED_MPS
    assert np.ptp(start) < 1e-3
    # Where a step is late, the drone has arrived and stands until then.
    arrived = np.isclose(x / CELL_M % 1.0, 0.5)
    assert (speed[flying & ~arrived] == SPEED_MPS).all()
    for message in messages:
        assert message.header.frame_id == "map"
        assert message.child_frame_id == "drone0/base_link"
        assert message.pose.pose.position.y == 9.5 * CELL_M
        orientation = message.pose.pose.orientation
        assert (orientation.z, orientation.w) == (0.0, 1.0)


def test_the_clock_goes_on_between_steps_and_over_resets(sim: Sim, clock: Inbox) -> None:
    for _ in range(3):
        seen, after = len(sim.reports), len(clock)
        sim.next_report(seen)
        sim.rig.until(lambda after=after: len(clock) > after + 3)  # type: ignore[misc]
        before = stamp_ns(sim.reports.last)
        sim.reset()
        assert stamp_ns(sim.reports.last) >= before + STEP_NS
    assert any(time % STEP_NS for time in times_of(clock))


def test_other_speeds_do_not_turn_the_clock_back(sim: Sim, clock: Inbox) -> None:
    sim.set(step_rate=0.0)
    for factor in (65.0, 13.0, 100.0, 26.0, 130.0, 1.0, 65.0):
        after = len(clock)
        sim.set(real_time_factor=factor)
        sim.rig.until(lambda after=after: len(clock) > after + 2)  # type: ignore[misc]
    seen = len(sim.reports)
    sim.next_report(seen)


def test_time_stands_still_while_paused_and_goes_on_from_there(sim: Sim, clock: Inbox) -> None:
    sim.next_report(len(sim.reports))
    began_s = time.monotonic()
    sim.set(step_rate=0.5)
    ticks = len(clock)
    sim.rig.until(lambda: len(clock) > ticks)
    first_ns = times_of(clock)[ticks]
    sim.pause(True)
    moved_s = time.monotonic() - began_s
    sim.health_when(lambda h: h["state"] == "paused")
    steps, ticks = len(sim.reports), len(clock)
    # More than a second, half a step.
    sim.health()
    sim.health()
    # Repeated for late joiners, and unchanged.
    paused_ns = times_of(clock)[ticks - 1]
    assert len(sim.reports) == steps and set(times_of(clock)[ticks:]) == {paused_ns}
    resumed_s = time.monotonic()
    sim.pause(False)
    sim.rig.until(lambda: times_of(clock)[-1] > paused_ns)
    # The wall time of the pause, more than a second, is not in it.
    moved_s += time.monotonic() - resumed_s
    next_ns = next(ns for ns in times_of(clock) if ns > paused_ns)
    assert next_ns - first_ns <= 0.5 * moved_s * STEP_NS
    sim.set(step_rate=5.0)
    last = step_report_from_message(sim.reports[steps - 1])
    assert sim.next_report(steps)["step"][0] == last["step"][0] + 1


def test_a_mission_in_real_time_ends_and_starts_anew(sim: Sim, clock: Inbox) -> None:
    sim.command(0, LEFT)
    sim.rig.until(lambda: sim.report["terminated"][0])
    sim.health_when(lambda h: h["state"] == "mission over")
    steps = len(sim.reports)
    sim.health()
    assert len(sim.reports) == steps
    sim.reset()
    sim.rig.until(lambda: sim.step_number >= 2)


def test_who_leaves_real_time_between_two_cells_stands_in_the_next(sim: Sim) -> None:
    sim.set(step_rate=1.0)
    with sim.rig.listening(Odometry, "/drone0/odom") as odom:
        sim.rig.until(lambda: odom)
        sim.command(0, RIGHT)
        sim.rig.until(lambda: odom and odom.last.twist.twist.linear.x == SPEED_MPS)
        sim.set(step_mode="lockstep")
        sim.rig.until(lambda: odom.last.twist.twist.linear.x == 0.0, "a drone that stands")
        assert odom.last.pose.pose.position.x == (sim.cells[0][0] + 0.5) * CELL_M
        assert stamp_ns(odom.last) >= stamp_ns(odom[-2])


def test_by_hand_each_call_is_one_step(sim: Sim) -> None:
    sim.set(step_mode="manual")
    sim.reset()
    sim.command(0, RIGHT)
    sim.wait_until_quiet()
    seen = len(sim.reports)
    sim.health()
    sim.health()
    assert len(sim.reports) == seen
    assert sim.trigger("step") == (True, "step 1")
    assert sim.next_report(seen)["action"].tolist() == [RIGHT]
    assert sim.trigger("step") == (True, "step 2")
    assert sim.next_report(seen + 1)["action"].tolist() == [SEARCH]
    assert len(sim.reports) == seen + 2


def test_a_mission_can_pass_from_one_mode_to_the_other(sim: Sim) -> None:
    sim.set(step_mode="lockstep", step_rate=0.0)
    sim.reset()
    assert sim.fly(RIGHT)["step"][0] == 1
    seen = len(sim.reports)
    sim.set(step_mode="manual")
    sim.joint(DOWN)
    sim.wait_until_quiet()
    assert len(sim.reports) == seen
    # What was commanded is waited for no longer.
    sim.set(step_mode="lockstep")
    assert sim.next_report(seen)["action"].tolist() == [DOWN]
    sim.set(step_rate=5.0)
    sim.set(step_mode="realtime")
    sim.next_report(seen + 2)

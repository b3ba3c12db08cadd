# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A lockstep mission between processes: the barrier, its commands and what a late joiner gets."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseStamped
from nav_msgs.msg import OccupancyGrid
from rig import LATCHED, Rig, Sim, cells, content, occupancy, stamp_ns, steps_of
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import String

from dsse_ros.base.result import Accepted
from dsse_ros.mission.run.command_parsers import parse_goal
from dsse_ros.world.scenario.agents import agents_from_json
from dsse_ros.world.scenario.frames import map_positions
from msg_adapters.images import image_to_probability
from msg_adapters.occupancy import probability_to_occupancy
from msg_adapters.poses import pose_from_message, pose_stamped
from msg_adapters.stamps import header, to_stamp
from msg_adapters.step_report import step_report_from_message

LEFT, RIGHT, UP, DOWN, SEARCH = range(5)
NO_ACTION = -1
START = [(0, 0), (3, 0), (6, 0)]
DEFAULTS = {
    "seed": 7, "auto_reset": False, "command_timeout": 0.0, "missing_action": "search",
    "step_rate": 0.0, "step_mode": "lockstep",
}  # fmt: skip


@pytest.fixture(scope="module")
def node(rig: Rig) -> Sim:
    return rig.sim(
        {
            "grid_size": 8,
            "drones_positions": [part for cell in START for part in cell],
            "person_initial_position": [7, 7],
            "probability_of_detection": 0.0,
            "vector": [-0.3, -0.2],
            "sigma": 2.0,
            "timestep_limit": 100000,
            "seed": 7,
        }
    )


@pytest.fixture
def sim(node: Sim) -> Iterator[Sim]:
    node.pause(False)
    node.set(**DEFAULTS)
    node.reset()
    yield node


def goal(sim: Sim, drone: int, cell: tuple[int, int]) -> None:
    frame = agents_from_json(sim.rig.first(String, sim.topic("agents")).data).frame
    sim.talk(PoseStamped, f"drone{drone}/command_pose").publish(
        pose_stamped(header(frame.map_frame, to_stamp(0)), *map_positions(frame, [cell], drone))
    )


def test_a_resend_that_has_crossed_the_step_is_no_refusal(sim: Sim) -> None:
    before = sim.health()
    mission = sim.search[1]
    # In flight when the step is done, and when the mission is over.
    for step, actions in enumerate([(RIGHT, DOWN, DOWN), (UP, UP, SEARCH), (UP, UP, UP)]):
        sim.joint(*actions, mission=mission)
        sim.rig.until(lambda step=step: sim.step_number == step + 1)  # type: ignore[misc]
        sim.joint(*actions, mission=mission, step=step)
        if not sim.flying:
            break
    sim.wait_until_quiet()
    health = sim.health()
    assert int(health["duplicates"]) - int(before["duplicates"]) == sim.step_number
    assert health["rejected"] == before["rejected"]
    # Anything but an exact duplicate is refused.
    sim.joint(UP, UP, LEFT, mission=mission, step=step)
    sim.health_after("stale_step")


def test_a_resend_after_a_reset_is_no_refusal_either(sim: Sim) -> None:
    before = sim.health()
    mission = sim.search[1]
    sim.joint(RIGHT, DOWN, DOWN, mission=mission)
    sim.rig.until(lambda: sim.step_number == 1)
    sim.reset()
    sim.joint(RIGHT, DOWN, DOWN, mission=mission, step=0)
    sim.wait_until_quiet()
    health = sim.health()
    assert (health["step"], health["rejected"]) == ("0", before["rejected"])
    assert int(health["duplicates"]) == int(before["duplicates"]) + 1
    # The same actions for the new mission are a command.
    sim.joint(RIGHT, DOWN, DOWN)
    sim.rig.until(lambda: sim.step_number == 1)


def test_the_node_says_whose_commands_it_waits_for(sim: Sim) -> None:
    def logged() -> list[str]:
        lines = sim.process.output.splitlines()
        return [line for line in lines if "step 2: waiting for commands of" in line]

    before = len(logged())
    for _ in range(2):
        sim.fly(SEARCH, SEARCH, SEARCH)
    # A command might come before or after the line, which is logged once the step is a second old.
    sim.rig.until(lambda: len(logged()) > before, "the line in the log")
    assert "of drone0, drone1, drone2: a publisher on joint_action, but no command" in logged()[-1]
    sim.command(1, "down")
    health = sim.health_when(lambda h: "waiting for commands of drone0, drone2" in h["message"])
    assert health["level"] in (b"\0", b"\1") and health["state"] == "running"
    # Once in ten seconds, not once a second.
    sim.health()
    sim.health()
    assert len(logged()) == before + 1
    sim.set(step_mode="manual")
    sim.health_when(lambda h: "waiting for a call of ~/step" in h["message"])
    sim.pause(True)
    assert "waiting" not in sim.health()["message"]


def test_while_it_waits_the_clock_is_repeated_and_stands_still(sim: Sim) -> None:
    with sim.rig.listening(Clock, "/clock") as clock:
        sim.rig.until(lambda: len(clock) >= 3, "a clock for late joiners")
        now = stamp_ns(sim.reports.last)
        assert {m.clock.sec * 10**9 + m.clock.nanosec for m in clock} == {now} and now > 0
        sim.fly(SEARCH, SEARCH, SEARCH)
        sim.rig.until(lambda: clock.last.clock == sim.reports.last.header.stamp)
    assert stamp_ns(sim.reports[0]) == 13 * 10**9


def test_diagnostics_have_the_time_of_the_wall(sim: Sim) -> None:
    with sim.rig.listening(DiagnosticArray, "/diagnostics") as inbox:
        sim.rig.until(lambda: inbox)
        assert abs(stamp_ns(inbox.last) / 1e9 - time.time()) < 60


def test_commands_for_a_mission_that_is_over_are_logged_once(sim: Sim) -> None:
    sim.fly(UP, UP, UP)
    before = sim.process.output.count("the mission is over")
    for _ in range(3):
        sim.joint(SEARCH, SEARCH, SEARCH)
        sim.health_after("mission_over")
        time.sleep(1.1)
    assert sim.process.output.count("the mission is over") == before + 1


def test_the_log_shows_commands_and_steps_to_who_asks(rig: Rig) -> None:
    fields = {"num_drones": 2, "seed": 1, "publish_clock": False}
    loud = rig.sim(fields, "--log-level", "debug", namespace="/loud")
    loud.fly(RIGHT, SEARCH)
    for text in ("joint_action: (1, 4)", "step 1: right, search"):
        rig.until(lambda text=text: text in loud.process.output, text)  # type: ignore[misc]
    quiet = rig.sim(fields, namespace="/quiet")
    quiet.fly(RIGHT, SEARCH)
    quiet.wait_until_quiet()
    assert "right, search" not in quiet.process.output


def test_nothing_moves_until_all_drones_have_commanded(sim: Sim) -> None:
    seen = len(sim.reports)
    sim.command(0, "search")
    health = sim.health_when(lambda h: h["missing_drones"] == "drone1, drone2")
    assert health["step"] == "0" and len(sim.reports) == seen
    sim.command(1, "down")
    health = sim.health_when(lambda h: h["missing_drones"] == "drone2")
    assert health["step"] == "0" and len(sim.reports) == seen
    sim.command(2, LEFT)
    report = sim.next_report(seen)
    assert report["step"].tolist() == [1, 1, 1]
    assert report["action"].tolist() == [SEARCH, DOWN, LEFT]
    assert cells(report) == [(0, 0), (3, 1), (5, 0)]


def test_a_late_joiner_gets_everything_about_the_last_step(sim: Sim) -> None:
    sim.fly(SEARCH, DOWN, LEFT)
    sim.fly(SEARCH, RIGHT, DOWN)
    listener = Rig(sim.rig.folder, sim.rig.domain)
    try:
        with listener.listening(PointCloud2, "step_report", LATCHED) as reports:
            # Those before it are kept too.
            listener.until(lambda: reports and content(reports.last) == content(sim.reports.last))
            cloud = reports.last
        here = cells(step_report_from_message(cloud))
        assert here == [(0, 0), (4, 1), (5, 1)]
        info = agents_from_json(listener.first(String, "agents").data)
        assert info.agents == ("drone0", "drone1", "drone2") and info.seed == 7
        grid = listener.first(OccupancyGrid, "probability_grid")
        image = listener.first(Image, "probability")
        expected = probability_to_occupancy(image_to_probability(image))
        assert np.array_equal(occupancy(grid), expected[::-1])
        drones = listener.first(PoseArray, "drones")
        poses = [listener.first(PoseStamped, f"drone{i}/pose") for i in range(3)]
        assert [parse_goal(pose_from_message(pose), info.frame) for pose in poses] == [
            Accepted(cell) for cell in here
        ]
        assert list(drones.poses) == [pose.pose for pose in poses]
        for message in (cloud, grid, image, drones, *poses):
            assert stamp_ns(message) == stamp_ns(cloud)
            assert message.header.frame_id == "map"
    finally:
        listener.close()


def test_agents_has_the_actions_the_rules_and_the_place(sim: Sim) -> None:
    published = json.loads(sim.rig.first(String, "agents").data)
    assert published["agents"] == ["drone0", "drone1", "drone2"]
    assert published["actions"] == ["left", "right", "up", "down", "search"]
    assert published["rules"] == "paper"
    assert published["seed"] == 7
    assert published["origin"] == {"lat_deg": -24.04, "lon_deg": -46.17, "alt_m": 0.0}


def test_the_last_command_of_a_drone_wins(sim: Sim) -> None:
    seen = len(sim.reports)
    # Held, or the step would be done as soon as each drone has its first command.
    sim.pause(True)
    try:
        for action in (LEFT, UP, RIGHT):
            sim.command(0, action)
        sim.command(1, SEARCH)
        goal(sim, 2, (0, 0))
        sim.wait_until_quiet()
        sim.command(1, "right")
        sim.command(2, "down")
        sim.wait_until_quiet()
        assert len(sim.reports) == seen
    finally:
        sim.pause(False)
    assert sim.next_report(seen)["action"].tolist() == [RIGHT, RIGHT, DOWN]


def test_a_command_is_for_one_step(sim: Sim) -> None:
    sim.fly(RIGHT, RIGHT, RIGHT)
    seen = len(sim.reports)
    sim.command(0, DOWN)
    sim.command(1, DOWN)
    health = sim.health_when(lambda h: h["missing_drones"] == "drone2")
    assert health["step"] == "1" and len(sim.reports) == seen


def test_a_joint_action_counts_for_all_drones_or_for_none(sim: Sim) -> None:
    seen = len(sim.reports)
    for actions in ([RIGHT, RIGHT, 5], [RIGHT, RIGHT], [RIGHT] * 4, []):
        sim.joint(*actions)
    sim.joint(RIGHT, RIGHT, RIGHT, step=1)
    sim.joint(RIGHT, RIGHT, RIGHT, step=-1)
    health = sim.health_after("unknown_action", *["wrong_size"] * 3, *["stale_step"] * 2)
    assert health["missing_drones"] == "drone0, drone1, drone2"
    assert health["step"] == "0" and len(sim.reports) == seen
    assert sim.fly(RIGHT, RIGHT, RIGHT)["action"].tolist() == [RIGHT] * 3


def test_a_stale_joint_action_is_refused(sim: Sim) -> None:
    sim.fly(RIGHT, RIGHT, RIGHT)
    # Refusals of one kind are logged once a second, and the test before has had one.
    time.sleep(1.1)
    sim.joint(DOWN, DOWN, DOWN, step=0)
    assert sim.health_after("stale_step")["step"] == "1"
    sim.rig.until(lambda: "data[1] must be step 1, got 0" in sim.process.output, "the line")


def test_a_reset_clears_the_commands(sim: Sim) -> None:
    sim.command(0, RIGHT)
    goal(sim, 1, (7, 7))
    sim.wait_until_quiet()
    sim.reset()
    seen = len(sim.reports)
    sim.command(2, DOWN)
    sim.health_when(lambda h: h["missing_drones"] == "drone0, drone1")
    assert len(sim.reports) == seen


def test_a_reset_repeats_the_mission_at_later_times(sim: Sim) -> None:
    script = [(RIGHT, DOWN, SEARCH), (DOWN, SEARCH, LEFT), (SEARCH, LEFT, DOWN)]
    first = len(sim.reports) - 1
    for actions in script:
        sim.fly(*actions)
    second = len(sim.reports)
    sim.reset()
    for actions in script:
        sim.fly(*actions)
    before, after = sim.reports[first:second], sim.reports[second:]
    assert steps_of(before) == steps_of(after)
    times = [stamp_ns(m) for m in [*before, *after]]
    assert np.diff(times).tolist() == [13 * 10**9] * 7


def test_another_seed_is_another_mission(sim: Sim) -> None:
    with sim.rig.listening(String, "agents", LATCHED) as agents:
        sim.set(seed=8)
        sim.reset()
        sim.rig.until(lambda: agents and json.loads(agents.last.data)["seed"] == 8)


def test_goals_are_flown_cell_by_cell(sim: Sim) -> None:
    first = len(sim.reports)
    goal(sim, 0, (2, 1))
    goal(sim, 1, (4, 2))
    goal(sim, 2, (6, 3))
    sim.rig.until(lambda: sim.step_number == 3)
    sim.health_when(lambda h: h["missing_drones"] == "drone0, drone1, drone2")
    tracks = [cells(step_report_from_message(m)) for m in sim.reports[first - 1 :]]
    assert len(tracks) == 4
    for track, start, end in zip(
        zip(*tracks, strict=True), START, [(2, 1), (4, 2), (6, 3)], strict=True
    ):
        assert (track[0], track[-1]) == (start, end)
        assert all(abs(a[0] - b[0]) + abs(a[1] - b[1]) == 1 for a, b in zip(track, track[1:]))  # noqa: B905
    assert [track[1] for track in tracks] == [(3, 0), (3, 1), (4, 1), (4, 2)]


def test_the_way_to_a_goal_leaves_time_for_other_callbacks(rig: Rig) -> None:
    side = 400
    sim = rig.sim({"grid_size": side, "drones_positions": [0, 0], "seed": 7}, namespace="/wide")
    goal(sim, 0, (side - 1, side - 1))
    sim.rig.until(lambda: sim.step_number > 0)
    for _ in range(3):
        step = sim.step_number
        sim.get("seed")
        sim.rig.until(lambda step=step: sim.step_number > step)  # type: ignore[misc]
    assert sim.step_number < 2 * (side - 1)
    sim.process.stop()


def test_a_drone_that_left_the_grid_is_not_waited_for(sim: Sim) -> None:
    report = sim.fly(LEFT, SEARCH, SEARCH)
    assert report["terminated"].tolist() == [1, 0, 0]
    assert report["reward"][0] == -100000
    seen = len(sim.reports)
    sim.command(1, DOWN)
    sim.command(2, DOWN)
    report = sim.next_report(seen)
    assert report["action"].tolist() == [NO_ACTION, DOWN, DOWN]
    sim.command(0, "search")
    assert sim.health_after("drone_terminated")["drones_in_flight"] == "2"


def test_a_mission_that_is_over_says_so_and_waits_for_a_reset(sim: Sim) -> None:
    assert sim.fly(UP, UP, UP)["terminated"].all()
    sim.joint(SEARCH, SEARCH, SEARCH)
    health = sim.health_after("mission_over")
    assert health["state"] == "mission over"
    assert health["missing_drones"] == "" and health["drones_in_flight"] == "0"
    assert sim.trigger("step") == (False, "the mission is over; call ~/reset for a new one")
    sim.reset()
    assert sim.fly(SEARCH, SEARCH, SEARCH)["step"][0] == 1


def test_auto_reset_goes_on_with_the_next_seed(sim: Sim) -> None:
    sim.set(auto_reset=True)
    seen = len(sim.reports)
    sim.joint(UP, UP, UP)
    assert sim.next_report(seen)["terminated"].all()
    assert sim.next_report(seen + 1)["step"].tolist() == [0, 0, 0]
    assert cells(sim.next_report(seen + 1)) == START
    sim.rig.until(lambda: json.loads(sim.rig.first(String, "agents").data)["seed"] == 8)
    sim.joint(UP, UP, UP, step=0)
    sim.next_report(seen + 3)
    sim.rig.until(lambda: json.loads(sim.rig.first(String, "agents").data)["seed"] == 9)


@pytest.mark.parametrize(
    ("missing_action", "action", "held"),
    [("search", SEARCH, 0), ("repeat", DOWN, 0), ("hold", NO_ACTION, 1)],
)
def test_who_does_not_command_in_time_gets_the_missing_action(
    sim: Sim, missing_action: str, action: int, held: int
) -> None:
    sim.fly(DOWN, DOWN, DOWN)
    seen = len(sim.reports)
    sim.command(1, RIGHT)
    sim.wait_until_quiet()
    sim.set(missing_action=missing_action)
    sim.set(command_timeout=0.2)
    report = sim.next_report(seen)
    sim.set(command_timeout=0.0)
    assert report["action"].tolist() == [action, RIGHT, action]
    assert report["held"].tolist() == [held, 0, held]


def test_without_a_command_in_time_abort_ends_the_mission(sim: Sim) -> None:
    seen = len(sim.reports)
    sim.set(missing_action="abort")
    assert sim.trigger("step") == (False, "no command from drone0, drone1, drone2")
    sim.command(1, RIGHT)
    sim.wait_until_quiet()
    sim.set(command_timeout=0.05)
    health = sim.health_when(lambda h: h["state"] == "mission aborted")
    assert health["level"] == b"\x02" and health["step"] == "0" and len(sim.reports) == seen
    assert int(health["timeouts"]) >= 1
    sim.rig.until(
        lambda: "mission aborted: no command from drone0, drone2" in sim.process.output, "the line"
    )
    sim.set(command_timeout=0.0)
    sim.reset()
    assert sim.health()["state"] == "running"


def test_waiting_for_the_rate_is_no_missing_command(sim: Sim) -> None:
    sim.set(step_rate=2.0)
    sim.fly(RIGHT, RIGHT, RIGHT)
    seen = len(sim.reports)
    # Held, or on a busy machine the time-out would come before the command.
    sim.pause(True)
    sim.joint(DOWN, DOWN, DOWN)
    sim.wait_until_quiet()
    sim.set(command_timeout=0.1)
    sim.pause(False)
    assert sim.next_report(seen)["action"].tolist() == [DOWN] * 3
    sim.set(command_timeout=0.0)
    # Whatever time-out there may have been since then: none before.
    sim.rig.until(lambda: "vehicles are late" not in sim.process.output, "the line")


def test_without_commands_too_there_are_no_more_steps_than_the_rate_allows(sim: Sim) -> None:
    seen = len(sim.reports)
    timeouts = sim.health()["timeouts"]
    sim.set(step_rate=0.001, command_timeout=0.01)
    sim.health()
    assert sim.health()["timeouts"] == timeouts and len(sim.reports) == seen
    # No command is what it waited for, so this does not need one either.
    sim.set(step_rate=0.0)
    assert sim.next_report(seen)["action"].tolist() == [SEARCH] * 3
    sim.set(command_timeout=0.0)


def test_a_paused_mission_takes_commands_and_steps_when_it_goes_on(sim: Sim) -> None:
    seen = len(sim.reports)
    sim.pause(True)
    sim.joint(RIGHT, DOWN, LEFT)
    health = sim.health_when(lambda h: h["missing_drones"] == "")
    assert health["state"] == "paused" and len(sim.reports) == seen
    sim.pause(False)
    assert sim.next_report(seen)["action"].tolist() == [RIGHT, DOWN, LEFT]


def test_a_pause_does_not_end_the_time_out(sim: Sim) -> None:
    seen = len(sim.reports)
    sim.pause(True)
    sim.set(command_timeout=0.05)
    health = sim.health()
    assert health["state"] == "paused" and len(sim.reports) == seen
    sim.pause(False)
    assert sim.next_report(seen)["action"].tolist() == [SEARCH] * 3


def test_each_action_has_the_number_of_its_name(sim: Sim) -> None:
    for action, name in enumerate(("left", "right", "up", "down", "search")):
        sim.reset()
        seen = len(sim.reports)
        for drone in range(3):
            sim.command(drone, name)
        assert sim.next_report(seen)["action"].tolist() == [action] * 3

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""sim_node waits for vehicles, whose states the test publishes."""

from __future__ import annotations

import csv
from collections.abc import Iterator

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rig import LATCHED, RELIABLE, Rig, Sim, stamp_ns
from visualization_msgs.msg import MarkerArray

from msg_adapters.stamps import to_stamp
from msg_adapters.vehicles import Progress, vehicle_state_message

LEFT, RIGHT, UP, DOWN, SEARCH = range(5)
GRID, CELL_M = 8, 100.0


@pytest.fixture(scope="module")
def node(rig: Rig) -> Sim:
    return rig.sim(
        {
            "grid_size": GRID,
            "cell_size": CELL_M,
            "drones_positions": [0, 0, 4, 0, 7, 7],
            "person_initial_position": [2, 5],
            "probability_of_detection": 0.0,
            "vehicle_time": "awaited",
            "acceptance_radius": 12.0,
            "seed": 3,
            "record_file": str(rig.folder / "vehicles.csv"),
        }
    )


@pytest.fixture
def sim(node: Sim) -> Iterator[Sim]:
    node.set(acceptance_radius=12.0, command_timeout=0.0, auto_reset=False)
    node.reset()
    yield node


def pose(sim: Sim, drone: int, col: float, row: float, frame: str = "map") -> None:
    """Say where a vehicle is; a fraction lies between cells."""
    message = PoseStamped()
    message.header.frame_id = frame
    message.pose.position.x = (col + 0.5) * CELL_M
    message.pose.position.y = (GRID - 1 - row + 0.5) * CELL_M
    sim.talk(PoseStamped, f"drone{drone}/vehicle_pose").publish(message)


def publish_state(
    sim: Sim, drone: int, *, arrived: bool = False, looked: bool = False, lost: str = "",
    before: int = 0,
) -> None:  # fmt: skip
    """Say how far a vehicle has come with its task, or with one that many before."""
    task = int(sim.tasks()["task"][drone]) - before
    progress = Progress(task, task if arrived or looked else -1, task if arrived else -1, lost)
    message = vehicle_state_message(
        f"drone{drone}", "none", to_stamp(0), progress,
        level="ok", message="", values={},
    )  # fmt: skip
    sim.talk(DiagnosticArray, f"drone{drone}/vehicle_state").publish(message)


def all_there(sim: Sim) -> None:
    """Say that all vehicles have done their tasks."""
    for drone, task in enumerate(sim.tasks()):
        publish_state(sim, drone, arrived=True)
        pose(sim, drone, int(task["col"]), int(task["row"]))


def flown(sim: Sim, *actions: int) -> None:
    """Do a step whose vehicles arrive."""
    all_there(sim)
    seen = len(sim.reports)
    sim.begin(*actions)
    all_there(sim)
    sim.next_report(seen)


def test_vehicles_begin_when_all_have_a_command_and_the_step_is_done_when_they_have_arrived(
    sim: Sim,
) -> None:
    seen = len(sim.reports)
    all_there(sim)
    tasks = sim.begin(RIGHT, SEARCH, LEFT)
    assert tasks[["col", "row", "action"]].tolist() == [
        (1, 0, RIGHT), (4, 0, SEARCH), (6, 7, LEFT)
    ]  # fmt: skip
    assert [p.x for p in tasks.view(np.recarray)] == [150.0, 450.0, 650.0]
    for drone, (col, row) in enumerate([(1, 0), (4, 0.13), (6, 7)]):
        publish_state(sim, drone, arrived=True)
        pose(sim, drone, col, row)
    assert sim.health_when(lambda h: h["awaited_vehicles"] == "drone1")["missing_drones"] == ""
    assert len(sim.reports) == seen
    pose(sim, 1, 4, 0.11)
    assert sim.next_report(seen)["action"].tolist() == [RIGHT, SEARCH, LEFT]


def test_the_node_says_whose_vehicles_it_waits_for(sim: Sim) -> None:
    all_there(sim)
    pose(sim, 1, 0, 0)
    sim.wait_until_quiet()
    sim.joint(RIGHT, RIGHT, LEFT)
    sim.health_when(lambda h: "waiting for vehicles of drone1" in h["message"])
    pose(sim, 2, 0, 0)
    sim.reset()
    text = "waiting for commands of drone0, drone1, drone2 and vehicles of drone0, drone1, drone2"
    sim.health_when(lambda h: text in h["message"])
    sim.rig.until(lambda: f"step 0: {text}" in sim.process.output, "the line in the log")


def test_a_step_waits_for_the_end_of_a_search_though_the_vehicle_is_there(sim: Sim) -> None:
    all_there(sim)
    seen = len(sim.reports)
    sim.begin(SEARCH, SEARCH, SEARCH)
    for drone, (col, row) in enumerate(sim.cells):
        publish_state(sim, drone, arrived=drone != 2, looked=True)
        pose(sim, drone, col, row)
    sim.health_when(lambda h: h["awaited_vehicles"] == "drone2")
    assert len(sim.reports) == seen
    publish_state(sim, 2, arrived=True)
    assert sim.next_report(seen)["step"][0] == 1


def test_once_the_step_has_begun_another_joint_action_for_it_is_refused(sim: Sim) -> None:
    all_there(sim)
    sim.begin(RIGHT, RIGHT, LEFT)
    sim.health()
    sim.joint(RIGHT, RIGHT, LEFT)
    sim.joint(SEARCH, RIGHT, LEFT)
    health = sim.health_after("step_begun")
    assert health["rejected.step_begun"] == "1"
    seen = len(sim.reports)
    all_there(sim)
    assert sim.next_report(seen)["action"].tolist() == [RIGHT, RIGHT, LEFT]


def test_vehicles_that_are_late_are_not_waited_for_after_the_time_out(sim: Sim) -> None:
    seen = len(sim.reports)
    sim.joint(RIGHT, RIGHT, LEFT)
    sim.wait_until_quiet()
    sim.set(command_timeout=0.1)
    assert sim.next_report(seen)["action"].tolist() == [RIGHT, RIGHT, LEFT]
    sim.set(command_timeout=0.0)
    sim.rig.until(lambda: "vehicles are late" in sim.process.output, "the line")


def test_a_lost_drone_is_terminated_and_the_others_go_on_without_it(sim: Sim) -> None:
    all_there(sim)
    sim.wait_until_quiet()
    seen = len(sim.reports)
    publish_state(sim, 1, lost="link lost: no heartbeat for 5 s")
    published_again = sim.next_report(seen)
    assert published_again["terminated"].tolist() == [0, 1, 0]
    assert published_again["step"].tolist() == [0, 0, 0]
    assert stamp_ns(sim.reports[seen]) == stamp_ns(sim.reports[seen - 1])
    sim.begin(RIGHT, RIGHT, LEFT)
    all_there(sim)
    report = sim.next_report(seen + 1)
    assert report["action"].tolist() == [RIGHT, -1, LEFT]
    assert report["terminated"].tolist() == [0, 1, 0]
    assert report["col"].tolist() == [1, 4, 6]
    sim.command(1, RIGHT)
    health = sim.health_after("drone_terminated")
    assert health["lost_drones"] == "drone1" and health["drones_in_flight"] == "2"
    assert health["lost.drone1"] == "link lost: no heartbeat for 5 s"
    assert health["level"] == DiagnosticStatus.WARN
    assert "drone1 lost" in health["message"] and "refused" in health["message"]


def test_a_lost_drone_is_shown_as_such_before_the_next_step(sim: Sim) -> None:
    def grey(inbox: list[MarkerArray]) -> list[int]:
        shown = [m for m in inbox[-1].markers if m.ns == "drones"] if inbox else []
        return [m.id for m in shown if np.ptp([m.color.r, m.color.g, m.color.b]) == 0]

    with sim.rig.listening(MarkerArray, "markers", LATCHED) as markers:
        sim.rig.until(lambda: markers and not grey(markers))
        publish_state(sim, 1, lost="battery failsafe")
        sim.rig.until(lambda: grey(markers) == [1], "a grey drone")
        assert sim.step_number == 0


def test_a_second_bridge_on_the_same_vehicles_is_noticed(sim: Sim) -> None:
    topic = "drone0/vehicle_state"
    sim.talk(DiagnosticArray, topic)
    sim.health_when(lambda h: h[f"publishers.{topic}"] == "1")
    second = sim.rig.node.create_publisher(DiagnosticArray, topic, RELIABLE)
    health = sim.health_when(lambda h: h[f"publishers.{topic}"] == "2")
    assert health["level"] == DiagnosticStatus.WARN
    assert f"2 nodes publish {topic}" in health["message"]
    sim.rig.until(lambda: f"2 nodes publish {topic}" in sim.process.output, "the line")
    sim.rig.node.destroy_publisher(second)
    sim.health_when(lambda h: h[f"publishers.{topic}"] == "1")


def test_a_reset_brings_lost_drones_back_and_old_news_does_not_count(sim: Sim) -> None:
    publish_state(sim, 0, lost="taken over: in LOITER")
    sim.health_when(lambda h: h["lost_drones"] == "drone0")
    sim.reset()
    publish_state(sim, 0, lost="taken over: in LOITER", before=3)
    sim.wait_until_quiet()
    health = sim.health()
    assert health["lost_drones"] == "" and health["drones_in_flight"] == "3"


def test_the_mission_is_over_when_the_last_drone_is_lost(sim: Sim) -> None:
    seen = len(sim.reports)
    for drone in range(3):
        publish_state(sim, drone, lost="battery failsafe")
    assert sim.next_report(seen + 2)["terminated"].all()
    assert sim.health()["state"] == "mission over"
    assert not sim.trigger("step")[0]
    sim.rig.until(lambda: "over after 0 steps: no drone left" in sim.process.output, "the line")


def test_a_mission_that_has_lost_all_vehicles_waits_for_a_reset(sim: Sim) -> None:
    sim.set(auto_reset=True)
    seen = len(sim.reports)
    for drone in range(3):
        publish_state(sim, drone, lost="battery failsafe")
    mission = sim.health_when(lambda h: h["state"] == "mission over")["mission"]
    assert sim.health()["mission"] == mission and len(sim.reports) == seen + 3
    assert not sim.reset()["terminated"].any()


def test_the_record_has_the_last_step_once_and_with_its_lost_drones(sim: Sim) -> None:
    flown(sim, RIGHT, RIGHT, LEFT)
    for drone in range(3):
        publish_state(sim, drone, lost="battery failsafe")
    mission = sim.health_when(lambda h: h["state"] == "mission over")["mission"]
    with (sim.rig.folder / "vehicles.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["mission"] == mission]
    agents = ["drone0", "drone1", "drone2", "person0"]
    assert [(row["step"], row["agent"]) for row in rows] == [(s, a) for s in "01" for a in agents]
    assert [row["terminated"] for row in rows] == [*"000", "", *"111", ""]


@pytest.mark.parametrize(
    ("frame", "x", "code"), [("odom", 0.0, "foreign_frame"), ("map", float("nan"), "not_finite")]
)
def test_a_pose_that_says_nothing_is_counted_and_the_vehicle_is_nowhere(
    sim: Sim, frame: str, x: float, code: str
) -> None:
    sim.health()
    all_there(sim)
    sim.health_when(lambda h: h["awaited_vehicles"] == "")
    pose(sim, 0, x, 0.0, frame)
    assert sim.health_after(code)["awaited_vehicles"] == "drone0"


@pytest.mark.parametrize(
    "text", ["", "x", "1.0", "١", "9" * 5000, "--1"], ids=lambda text: text[:20]
)
def test_a_state_that_is_none_is_counted(sim: Sim, text: str) -> None:
    sim.health()
    message = vehicle_state_message(
        "drone0", "none", to_stamp(0), Progress(), level="ok", message="", values={}
    )
    for pair in message.status[0].values:
        if pair.key == "arrived_task":
            pair.value = text
    sim.talk(DiagnosticArray, "drone0/vehicle_state").publish(message)
    sim.talk(DiagnosticArray, "drone0/vehicle_state").publish(DiagnosticArray())
    sim.health_after("bad_state", "bad_state")

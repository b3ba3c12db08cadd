# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recorded missions that are flown again: what repeats, what differs, what cannot be replayed."""

from __future__ import annotations

import json
import re
import struct
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flown import MS, START_NS, Flown, with_byte, write
from geometry_msgs.msg import PoseStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from rclpy.serialization import serialize_message
from std_msgs.msg import Empty, String

from dsse_ros.base.fields import FieldError
from dsse_ros.cli.replay import main
from dsse_ros.mission.live.beliefs import LiveBeliefs
from dsse_ros.mission.live.history import HistoryTexts
from dsse_ros.mission.recording.bag import Recorded
from dsse_ros.mission.recording.bag_replay import Replay, ReplayedMission
from dsse_ros.mission.run.live_intake import LiveIntake
from dsse_ros.search.step.metres_paths import MOST_PIECES
from dsse_ros.search.step.viewpoints import viewpoints_at
from dsse_ros.world.scenario.frames import cell_to_map
from dsse_ros.world.scenario.rules import profile
from msg_adapters.stamps import to_stamp
from msg_adapters.step_report import step_report_from_message
from msg_adapters.topics import of_drones, replayed

SEARCH = 4
CHANGED_BYTES = 8
"""Of each topic, a hundred in all."""


def one(messages: Sequence[Recorded]) -> ReplayedMission:
    """The only mission of a bag, replayed."""
    (mission,) = Replay(messages).missions()
    return mission


def repeats(mission: ReplayedMission) -> bool:
    return not (mission.difference or mission.incomplete)


@pytest.mark.slow
@settings(max_examples=25)
@given(
    rules=st.sampled_from(["paper", "v1", "v2"]),
    seed=st.integers(0, 2**62),
    plan=st.lists(st.sampled_from(["joint", "each", "goal", "late", "refused"]), max_size=12),
    drift=st.booleans(),
)
def test_a_mission_repeats_byte_for_byte(
    rules: str, seed: int, plan: list[str], drift: bool
) -> None:
    flown = Flown(rules=rules, seed=seed, probability_of_detection=0.7, run_id=seed % 2**32 or 1)
    for number, what in enumerate(plan):
        if flown.mission.done:
            break
        match what:
            case "joint":
                flown.joint(number % 5, SEARCH, 0)
            case "each":
                for drone in flown.mission.live:
                    flown.action(drone, flown.mission.env.rules.actions[(number + drone) % 5])
            case "goal":
                x, y = cell_to_map(flown.frame, number % 8, 3)
                pose = PoseStamped()
                pose.header.frame_id = "map"
                pose.pose.position.x, pose.pose.position.y = float(x), float(y)
                flown.intake.take(1, "command_pose", flown.publish("drone1/command_pose", pose))
                flown.action(0, "search")
            case "refused":
                flown.action(0, "fly")
                flown.joint(1, 1, 1, step=99)
                flown.joint(SEARCH, SEARCH, SEARCH)
        flown.step("hold" if drift else "search")
    mission = one(flown.messages)
    assert repeats(mission), mission
    assert mission.steps == flown.mission.result.step


WORK = st.lists(st.lists(st.integers(0, 2), min_size=3, max_size=3), min_size=5, max_size=30)


@pytest.mark.slow
@settings(max_examples=15)
@given(WORK, st.sampled_from(["paper", "sea"]), st.sampled_from([0.0, 0.3]))
def test_a_mission_that_vehicles_flew_repeats_without_them(
    work: list[list[int]], rules: str, fault_rate: float
) -> None:
    flown = Flown(
        rules=profile(rules, vehicle_timed_actions=True), probability_of_detection=0.6,
        false_alarm_rate=fault_rate, false_alarm_steps=2, everything=True,
    )  # fmt: skip
    draw = np.random.default_rng(len(work))
    looks = [viewpoints_at(draw.integers(-1, 5, 3), *draw.integers(0, 8, (2, 3))) for _ in work]
    flown.fly(len(work), work, looks)
    mission = one(flown.messages)
    assert repeats(mission), mission
    assert mission.steps == flown.mission.result.step


def of_vehicles() -> Flown:
    """A mission in metres that vehicles fly."""
    return Flown(
        rules=profile("flight", vehicle_timed_actions=True, person_motion="constant_drift"),
        grid_size=20, particles=300, drones_positions=((9, 9), (10, 10), (3, 3)),
    )  # fmt: skip


def test_a_mission_in_metres_repeats_where_the_paths_of_vehicles_are_not_known() -> None:
    flown = of_vehicles()
    mission = flown.mission
    mission.report_wind((4.0, -3.0))
    flown.report()
    for step in range(12):
        # The last one leaves the grid.
        mission.command_all([(0.7, 0.3), (-step / 12, -1.0), (0.0, 1.0)])
        if step % 3:
            path = mission.ways(None)[0] * 130.0 + 65.0
            mission.set_flown(0, path + (step / 7, 0.0), np.ones(len(path), bool))
        flown.step("hold")
    found = one(flown.messages)
    assert repeats(found), found
    assert found.steps == 12


def test_a_mission_in_metres_repeats_in_the_winds_that_vehicles_reported() -> None:
    flown = of_vehicles()
    mission = flown.mission
    for step in range(8):
        if step == 2:
            mission.report_wind((4.0, -3.0))
            flown.report()
        mission.command_all([(0.1 * step, 1.0)] * 3)
        mission.begin("hold")
        if step == 5:
            mission.report_wind((-2.5, 0.1))
        moved = np.linspace(0.0, 50.0, MOST_PIECES + 1)[:, None]
        for drone in mission.live:
            path = mission.ways(None)[drone] * 130.0 + moved
            mission.set_flown(drone, path, np.ones(len(path), bool))
        flown.step("hold")
    found = one(flown.messages)
    assert repeats(found), found
    assert found.steps == 8
    at = flown.find("step_report", 3)
    del flown.messages[at]
    assert not repeats(one(flown.messages))


def test_each_mission_of_each_run_and_namespace_is_replayed() -> None:
    first = Flown(run_id=1, seed=4)
    first.fly(5)
    # Reset in the midst of it, and at the same seed.
    for seed in (5, 5):
        first.reset(seed)
        first.fly(4)
    second = Flown(run_id=2, start_ns=first.time_ns)
    second.fly(3)
    other = Flown(run_id=3, namespace="/other/")
    other.fly(2)
    found = list(Replay([*other.messages, *first.messages, *second.messages]).missions())
    assert all(repeats(mission) for mission in found)
    assert [(m.namespace, m.run_id, m.number, m.seed, m.steps) for m in found] == [
        ("/", 1, 1, 4, 5), ("/", 1, 2, 5, 4), ("/", 1, 3, 5, 4), ("/", 2, 1, 1, 3),
        ("/other/", 3, 1, 1, 2),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("field", "offset", "size"), [("reward", 24, 8), ("col", 32, 2), ("found", 39, 1)]
)
def test_one_changed_byte_in_a_report_is_found_and_named(
    field: str, offset: int, size: int
) -> None:
    flown = Flown()
    flown.fly(6)
    at = flown.find("step_report", 4)
    message = flown.messages[at]
    points = bytes(message.message.data)
    begin = message.data.index(points)
    width = message.message.point_step
    place = begin + width + offset + size - 1
    flown.messages[at] = with_byte(message, place, message.data[place] ^ 1)
    found = one(flown.messages).difference
    assert found.startswith(f"step 4, /step_report, drone1: {field} is ")


def test_a_changed_stamp_is_found_unless_stamps_are_wall_time() -> None:
    flown = Flown()
    flown.fly(6)
    for step in (3, 1):
        at = flown.find("step_report", step)
        # The seconds of the header's stamp stand behind the four bytes of the encapsulation.
        flown.messages[at] = with_byte(flown.messages[at], 4, 1)
        found = one(flown.messages).difference
        assert found.startswith(f"step {step}, /step_report: header.stamp")
    for step in range(7):
        at = flown.find("step_report", step)
        flown.messages[at] = with_byte(flown.messages[at], 5, 10 * step + 1)
    assert not one(flown.messages).difference


@pytest.mark.parametrize("step", [0, 1, 3])
def test_a_stamp_before_all_time_is_a_changed_one(step: int) -> None:
    flown = Flown()
    flown.fly(6)
    at = flown.find("step_report", step)
    sign = flown.messages[at].data[7] | 0x80
    flown.messages[at] = with_byte(flown.messages[at], 7, sign)
    found = one(flown.messages).difference
    assert found.startswith(f"step {step}, /step_report: header.stamp")


def test_a_mission_without_its_beginning_or_with_a_gap_is_named_as_such() -> None:
    flown = Flown()
    flown.fly(8)
    report = flown.messages[flown.find("step_report")]
    assert (
        "recorded from step 1 on" in one([m for m in flown.messages if m is not report]).incomplete
    )
    gap = flown.messages[flown.find("step_report", 5)]
    mission = one([m for m in flown.messages if m is not gap])
    assert mission.steps == 4 and "no report of step 5" in mission.incomplete
    agents = flown.messages[flown.find("agents")]
    flown.reset(2)
    missing, complete = Replay([m for m in flown.messages if m is not agents]).missions()
    assert "agents" in missing.incomplete and repeats(complete)


def test_a_mission_with_faults_repeats_from_its_commands() -> None:
    flown = Flown(
        seed=3, timestep_limit=60, command_drop_rate=0.2, stuck_rate=0.1, position_noise=0.5,
        false_alarm_rate=0.2, command_delay=1, battery_move=2.0, loss_rate=0.01,
    )  # fmt: skip
    flown.fly(60)
    mission = one(flown.messages)
    assert repeats(mission), mission
    assert mission.steps == flown.mission.result.step > 20
    reports = [m.message for m in flown.messages if m.topic == "/step_report"]
    points = np.stack([step_report_from_message(report) for report in reports])
    assert (points["command"] != points["action"]).any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rules", "fields"),
    [
        ("v2", {}),
        ("paper", {"position_noise": 0.5}),
        ("v1", {"person_amount": 2}),
        ("coverage", {}),
    ],
)
def test_every_message_that_follows_from_the_mission_is_compared(
    rules: str, fields: dict[str, Any]
) -> None:
    flown = Flown(rules=rules, belief=True, everything=True, timestep_limit=6, **fields)
    flown.fly(9)
    flown.reset(5)
    flown.fly(9)
    missions = list(Replay(flown.messages).missions())
    topics = {re.sub(r"^/|\d", "", message.topic) for message in flown.messages}
    assert len(missions) == 2
    for mission in missions:
        assert repeats(mission), mission
        compared = {topic.replace("<i>", "") for topic in mission.compared}
        assert compared == topics - {"agents", "joint_action"}


@pytest.fixture(scope="module")
def whole() -> Flown:
    """A mission with every topic that is compared."""
    flown = Flown(
        rules=profile("v2", person_motion="constant_drift"), particles=50, belief=True,
        everything=True, reveal_person=True, timestep_limit=4, battery_move=2.0,
    )  # fmt: skip
    flown.fly(9)
    assert flown.mission.done
    return flown


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({"step_report", *replayed("compared")}))
def test_any_changed_byte_of_a_compared_topic_is_found_and_named(whole: Flown, name: str) -> None:
    of_topic = [
        i for i, message in enumerate(whole.messages) if of_drones(message.topic) == f"/{name}"
    ]
    draw = np.random.default_rng(len(name))
    left = CHANGED_BYTES
    while left:
        at = int(draw.choice(of_topic))
        message = whole.messages[at]
        place, bit = int(draw.integers(4, len(message.data))), 1 << int(draw.integers(8))
        other = with_byte(message, place, message.data[place] ^ bit)
        try:
            if repr(other.message) == repr(message.message):
                continue  # It is of the padding.
            changed = [*whole.messages[:at], other, *whole.messages[at + 1 :]]
            found = one(changed).difference
        except FieldError as error:
            found = f", {error}"
        assert f", {message.topic}" in found, (message.topic, place, bit, found)
        left -= 1


def test_a_mission_on_a_probability_matrix_repeats_with_its_file(tmp_path: Path) -> None:
    np.save(tmp_path / "matrix.npy", np.random.default_rng(1).random((8, 8)))
    matrix = str(tmp_path / "matrix.npy")
    flown = Flown(rules="coverage", everything=True, probability_matrix=matrix)
    flown.fly(6)
    mission = one(flown.messages)
    assert repeats(mission) and "probability" in mission.compared


def test_messages_of_runs_with_the_same_stamps_belong_to_their_own() -> None:
    first = Flown(run_id=1, seed=4, everything=True)
    first.fly(3)
    second = Flown(run_id=2, seed=5, everything=True, sigma=1.0, start_ns=first.time_ns)
    second.fly(3)
    assert all(map(repeats, Replay([*first.messages, *second.messages]).missions()))


def test_drones_that_are_lost_with_their_vehicles_are_lost_again() -> None:
    flown = Flown()
    flown.fly(3)
    assert flown.mission.lose(1)
    flown.report()
    flown.fly(3)
    mission = one(flown.messages)
    assert repeats(mission) and mission.steps == 6
    assert mission.lost == ["drone1"]


def test_a_mission_that_goes_on_after_its_end_differs() -> None:
    flown = Flown(timestep_limit=3, person_pod_multipliers=[0.0])
    flown.fly(9)
    end = flown.messages[flown.find("step_report", -1)]
    report = bytearray(end.data)
    data = bytes(end.message.data)
    begin, width = end.data.index(data), end.message.point_step
    step = flown.mission.result.step
    for drone in range(3):
        struct.pack_into("<I", report, begin + drone * width + 12, step + 1)
    later = replace(end, data=bytes(report), publish_time_ns=end.publish_time_ns + MS)
    found = one([*flown.messages, later]).difference
    assert found.startswith(f"step {step + 1}: the mission is under way")


# The program


def test_the_program_counts_what_is_in_the_bag(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flown = Flown(run_id=12, seed=9, everything=True)
    flown.fly(6)
    poses = [message for message in flown.messages if message.topic.endswith("/pose")]
    late = flown.find("fix", 4)
    kept = [
        message for at, message in enumerate(flown.messages)
        if message not in poses[1:] and not (message.topic == "/drones" and at < late)
    ]  # fmt: skip
    assert main([str(write(tmp_path / "thin.mcap", kept))]) == 0
    line = capsys.readouterr().out.partition("\n")[0]
    drones = sum(one.topic == "/drones" for one in kept)
    assert (
        "6 steps repeat byte for byte in drone<i>/fix, drone<i>/path, drone<i>/pose (1 of " in line
    )
    assert f"drone<i>/pose (1 of 21 messages), drones ({drones} of 7 messages), markers, " in line
    assert line.count(" of ") == 3


def test_the_program_says_what_repeats_and_what_differs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flown = Flown(run_id=12, seed=9)
    flown.fly(6)
    bag = write(tmp_path / "whole.mcap", flown.messages)
    assert main([str(bag)]) == 0
    line = "mission 1 of run 12, seed 9: 6 steps repeat byte for byte in step_report"
    rest = "not compared: /agents, /joint_action\n"
    assert capsys.readouterr().out == f"{line}; the bag does not have its end\n{rest}"
    at = flown.find("step_report", 4)
    place = flown.messages[at].data.index(bytes(flown.messages[at].message.data))
    flown.messages[at] = with_byte(flown.messages[at], place, flown.messages[at].data[place] ^ 1)
    assert main([str(write(tmp_path / "changed.mcap", flown.messages))]) == 3
    assert "DIFFERS: step 4, /step_report, drone0: x is " in capsys.readouterr().out


def test_a_bag_that_is_cut_off_is_replayed_to_there_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flown = Flown(everything=True)
    flown.fly(12)
    path = write(tmp_path / "cut.mcap", flown.messages, per_chunk=7)
    size = path.stat().st_size // 2
    with path.open("r+b") as file:
        file.truncate(size)
    assert main([str(path)]) == 0
    mission, rest, cut = capsys.readouterr().out.splitlines()
    steps = int(re.findall(r"(\d+) steps repeat", mission)[0])
    assert 0 < steps < 12 and mission.endswith("the bag does not have its end")
    assert rest.startswith("not compared: /agents, ")
    assert cut == f"bag: {str(path)!r} is cut off at byte {size}"


@pytest.mark.parametrize(("missing", "code"), [(1, 0), (9, 0), (-60, 2)])
def test_a_bag_without_its_index_or_its_messages_is_named_as_cut_off(
    whole: Flown, tmp_path: Path, capsys: pytest.CaptureFixture[str], missing: int, code: int
) -> None:
    path = write(tmp_path / "cut.mcap", whole.messages)
    size = path.stat().st_size - missing if missing > 0 else -missing
    with path.open("r+b") as file:
        file.truncate(size)
    assert main([str(path)]) == code
    output = capsys.readouterr()
    last = (output.out + output.err).splitlines()[-1]
    where = f"is cut off at byte {size}"
    assert last.endswith(f"{where}, after its last message" if code == 0 else f"; it {where}")


@pytest.mark.parametrize("topic", ["/drones", "/probability", "/probability_of_success"])
def test_messages_of_a_step_whose_report_was_cut_off_are_not_compared(
    whole: Flown, topic: str
) -> None:
    report = whole.find("step_report", 3)
    last = next(i for i in range(report, 0, -1) if whole.messages[i].topic == topic)
    bag = Replay(whole.messages[: last + 1])
    (mission,) = bag.missions()
    assert repeats(mission) and mission.steps == 2 and not mission.ended
    assert bag.not_compared[topic] == (1, 4)


def test_displays_of_another_wall_time_are_not_compared_and_listed() -> None:
    flown = Flown(everything=True)
    flown.fly(3)
    displays = ("/probability_grid", "/drone0/path", "/markers")
    for step in range(4):
        for topic in ("/step_report", *displays):
            at = flown.find(topic, step)
            message = flown.messages[at].message
            for one_of in getattr(message, "markers", [message]):
                one_of.header.stamp = to_stamp(START_NS + step * MS + (topic in displays))
            data = bytes(serialize_message(message))
            flown.messages[at] = replace(flown.messages[at], data=data)
    kept = [m for m in flown.messages if m.topic in ("/agents", "/step_report", *displays)]
    bag = Replay(kept)
    (mission,) = bag.missions()
    assert repeats(mission), mission
    shown = {"/agents": (1, 1), "/probability_grid": (4, 4), "/drone<i>/path": (4, 4)}
    assert bag.not_compared == shown | {"/markers": (4, 4)}


def nothing(folder: Path) -> Path:
    return folder / "nothing.mcap"


def text(folder: Path) -> Path:
    path = folder / "text.mcap"
    path.write_text("no bag, but a text that is long enough")
    return path


def empty(folder: Path) -> Path:
    path = folder / "empty.mcap"
    path.touch()
    return path


def folder_without_bag(folder: Path) -> Path:
    return folder


def of_something_else(folder: Path) -> Path:
    flown = Flown()
    return write(folder / "else.mcap", [replace(flown.messages[0], topic="/chatter")])


def other_agents(folder: Path) -> Path:
    flown = Flown()
    flown.publish("agents", String(data="of another program"))
    return write(folder / "agents.mcap", flown.messages[-1:])


def without_beginning(folder: Path) -> Path:
    flown = Flown()
    flown.fly(2)
    report = flown.messages[flown.find("step_report")]
    return write(folder / "late.mcap", [m for m in flown.messages if m is not report])


def damaged(folder: Path) -> Path:
    flown = Flown()
    flown.fly(20)
    path = write(folder / "damaged.mcap", flown.messages, per_chunk=10)
    data = bytearray(path.read_bytes())
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[2]
    data[chunk.chunk_start_offset + chunk.chunk_length - 1] ^= 1
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (nothing, "No such file"),
        (text, "is not an MCAP file"),
        (empty, "has none of the topics"),
        (folder_without_bag, "without an MCAP file"),
        (of_something_else, "has none of the topics"),
        (other_agents, "not JSON"),
        (without_beginning, "no mission in the bag can be replayed"),
        (damaged, "is damaged"),
    ],
)
def test_what_is_no_bag_of_a_mission_gets_one_line(
    make: Callable[[Path], Path], reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(make(tmp_path))]) == 2
    error = capsys.readouterr().err
    assert error.startswith("replay: ") and error.count("\n") == 1 and reason in error


@pytest.mark.parametrize("topic", ["/agents", "/step_report", "/probability", "/drone0/pose"])
def test_a_topic_of_another_type_is_no_part_of_the_mission(topic: str) -> None:
    flown = Flown()
    flown.fly(3)
    flown.publish(topic, Empty())
    (mission,) = Replay(flown.messages).missions()
    assert not mission.difference


def test_a_bag_without_agents_is_refused() -> None:
    flown = Flown()
    with pytest.raises(FieldError, match="no message on agents"):
        list(Replay(flown.messages[1:]).missions())


def test_a_mission_on_a_larger_grid_than_is_allowed_is_not_replayed() -> None:
    flown = Flown()
    flown.fly(5)
    cells = flown.mission.env.scenario.grid_size.cells
    (mission,) = Replay(flown.messages, max_cells=cells - 1).missions()
    assert mission.incomplete.startswith("grid_size must ") and mission.steps == 0
    (mission,) = Replay(flown.messages, max_cells=cells).missions()
    assert not mission.incomplete and not mission.difference


def test_a_live_search_repeats_with_its_inputs_until_one_is_missing() -> None:
    flown = Flown(rules="v2", truth="none", belief=True, num_drones=2)
    intake, texts, inputs = (
        LiveIntake(flown.mission, lambda *_: None, Counter()),
        HistoryTexts(),
        [],
    )
    assert isinstance(flown.mission.beliefs, LiveBeliefs)
    places = ((300.0, 300.0), (600.0, 300.0), (300.0, 600.0))
    for step, (x, y) in enumerate(places):
        flown.joint(step, SEARCH)
        flown.step()
        intake.clock.set(flown.mission.result.step, float(step))
        for _ in range(2):
            intake.take(
                "detection", json.dumps({"id": f"d{len(inputs)}", "x": x, "y": y, "radius": 40})
            )
            intake.decide(step + 1.0)
            live_search = flown.mission.beliefs.live_search
            flown.publish(
                "live/history", String(data=texts.next((7, flown.mission.number), live_search))
            )
            inputs.append(flown.messages[-1])
            stamp = to_stamp(flown.mission.result.stamp_ns)
            for topic in ("probability", "probability_of_success", "belief"):
                flown.publish(topic, flown.messages_of_step.make(topic, stamp))
    intake.take("confirm", '{"id": "yes", "contact": "c1"}')
    intake.decide(4.0)
    flown.publish("live/history", String(data=texts.next((7, flown.mission.number), live_search)))
    flown.report()
    mission = one(flown.messages)
    assert repeats(mission) and mission.ended, mission
    assert mission.compared["probability"] == 2 * len(places)
    without = one([message for message in flown.messages if message is not inputs[-1]])
    assert without.incomplete or without.difference
    mission = one([message for message in flown.messages if "live" not in message.topic])
    assert mission.incomplete == "the bag has no live/history of step 1"

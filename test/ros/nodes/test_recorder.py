# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A mission of real nodes in a bag: recorded whole, read by others, replayed."""

from __future__ import annotations

import dataclasses
import signal
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from mcap.reader import make_reader
from rig import LATCHED, RELIABLE, Rig
from rosbags.highlevel import AnyReader
from rosbags.rosbag2.metadata import parse_qos
from std_msgs.msg import Int8, String

from dsse_ros.base.fields import FieldError
from dsse_ros.mission.recording.bag import Recorded, read_bag
from dsse_ros.mission.recording.bag_replay import Replay
from dsse_ros.ros.runtime.exit_codes import FAILED

DRONES, STEPS = 20, 300
MISSION = {
    "num_drones": DRONES, "grid_size": 20, "timestep_limit": STEPS, "seed": 6, "rules": "v2",
    "probability_of_detection": 0.0, "person_pod_multipliers": [0.0], "exit_at_end": True,
    # On a busy machine a recorder falls behind what is kept of topics other than the reports.
    "step_rate": 60.0,
}  # fmt: skip
# A planner keeps its last ten commands for a recorder that falls behind: too few on a busy machine.
PLANNER = {"planner": "sweep", "qos_overrides./joint_action.publisher.depth": 1000}
# A file that may have that many bytes stands for a disk that is full.
LIMITED = """\
import resource, sys
from dsse_ros.ros.nodes.recorder import main
resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))
sys.exit(main())
"""


@dataclass
class Bag:
    """A recorded mission.

    Attributes:
        path: The bag.
        killed: That of a recorder that was killed in the midst of it.
        limited: Log of a recorder with too small a disk, and its exit code.
    """

    path: Path
    killed: Path
    limited: tuple[str, int]


def written(path: Path) -> list[Recorded]:
    """Messages of a bag that may still be written."""
    found: list[Recorded] = []
    try:
        for recorded in read_bag(path):
            found.append(recorded)
    except FieldError:
        pass
    return found


def count(path: Path, topic: str) -> int:
    """Messages of a topic in a bag that may still be written."""
    return sum(recorded.topic == topic for recorded in written(path))


def commanded_steps(messages: Iterable[Recorded]) -> list[int]:
    """Steps of the joint actions, in order; one that was sent again counts once."""
    steps = (message.message.data[1] for message in messages if message.topic == "/joint_action")
    return list(dict.fromkeys(steps))


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bag]:
    """A mission of 20 drones over 300 steps, with three recorders."""
    folder = tmp_path_factory.mktemp("recorder")
    rig = Rig(folder)
    script = folder / "limited.py"
    script.write_text(LIMITED, encoding="utf-8")
    try:
        recorder = rig.start("recorder", {"bag": str(folder / "mission.mcap")})
        killed = rig.start("recorder", {"bag": str(folder / "killed.mcap")})
        limited = rig.run(script, "--ros-args", "-p", f"bag:={folder / 'limited.mcap'}")
        for process in (recorder, killed, limited):
            rig.until(lambda p=process: "recording /" in p.output, "a recorder")  # type: ignore[misc]
        sim = rig.start("sim_node", MISSION)
        path = folder / "mission.mcap"
        # The recorder finds topics one by one; what was published before is not in the bag.
        for topic in ("/agents", "/step_report"):
            rig.until(lambda t=topic: count(path, t), f"{topic} in the bag of the mission")  # type: ignore[misc]
        planner = rig.start("planner_node", PLANNER)
        rig.until(lambda: count(folder / "killed.mcap", "/step_report"), "a report in the bag")
        killed.kill()
        assert sim.wait() == 0, sim.output
        rig.until(lambda: count(path, "/step_report") > STEPS + 1, "all of /step_report")
        rig.until(lambda: commanded_steps(written(path))[-1:] == [STEPS], "the last /joint_action")
        planner.stop()
        recorder.stop()
        yield Bag(path, folder / "killed.mcap", (limited.output, limited.wait()))
    finally:
        rig.close()


@pytest.fixture(scope="module")
def messages(bag: Bag) -> list[Recorded]:
    return list(read_bag(bag.path))


def test_every_topic_and_command_of_the_mission_is_in_the_bag(messages: list[Recorded]) -> None:
    counted = Counter(message.topic for message in messages)
    each_step = [
        "/probability", "/probability_grid", "/probability_of_success", "/drones", "/step_report",
        *(f"/drone{i}/{name}" for i in range(DRONES) for name in ("pose", "odom", "fix")),
    ]  # fmt: skip
    others = ["/agents", "/mission_report", "/markers", "/joint_action", "/clock", "/diagnostics"]
    others += [f"/drone{i}/{name}" for i in range(DRONES) for name in ("path", "plan")]
    # The transforms are there where tf2_msgs is.
    assert counted.keys() - {"/tf", "/tf_static"} == {*each_step, *others}
    assert counted["/step_report"] == STEPS + 2
    # Once as the mission begins, once as the drones are commanded.
    assert counted["/agents"] == 2 and counted["/mission_report"] == 1
    # A recorder that discovers the planner late misses its first commands: they are volatile.
    commanded = commanded_steps(messages)
    assert commanded == list(range(commanded[0], STEPS + 1))


def test_messages_are_in_the_order_of_their_times(messages: list[Recorded]) -> None:
    times = [message.log_time_ns for message in messages]
    assert times == sorted(times)
    assert all(0 < message.publish_time_ns <= message.log_time_ns for message in messages)


def test_the_bag_has_the_quality_of_service_of_the_publishers(messages: list[Recorded]) -> None:
    policies = {
        topic: [(qos.reliability.name, qos.durability.name) for qos in parse_qos(offered)]
        for topic, offered in {message.topic: message.offered_qos for message in messages}.items()
    }
    assert policies["/step_report"] == [("RELIABLE", "TRANSIENT_LOCAL")]
    assert policies["/clock"] == [("RELIABLE", "VOLATILE")]
    assert policies["/drone3/fix"] == [("BEST_EFFORT", "VOLATILE")]


def test_rosbags_and_mcap_read_all_of_it(bag: Bag, messages: list[Recorded]) -> None:
    counted = Counter(message.topic for message in messages)
    with AnyReader([bag.path]) as reader:
        assert {t: info.msgcount for t, info in reader.topics.items()} == counted
        for connection in reader.connections:
            _, _, data = next(reader.messages([connection]))
            reader.deserialize(data, connection.msgtype)
    with bag.path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None and summary.statistics is not None
    assert summary.statistics.message_count == len(messages)


def test_the_mission_repeats_byte_for_byte(messages: list[Recorded]) -> None:
    bag = Replay(messages)
    (mission,) = bag.missions()
    assert not (mission.difference or mission.incomplete), mission
    assert (mission.steps, mission.seed) == (STEPS + 1, 6)
    assert mission.compared.keys() == {
        "drones", "markers", "mission_report", "probability", "probability_grid",
        "probability_of_success", "step_report", "drone<i>/pose", "drone<i>/fix", "drone<i>/path",
    }  # fmt: skip
    rest = {"/agents", "/clock", "/diagnostics", "/joint_action"}
    rest |= {f"/drone<i>/{name}" for name in ("odom", "plan")}
    assert bag.not_compared.keys() - {"/tf"} == rest


@pytest.mark.parametrize("topic", ["step_report", "probability", "drone3/pose"])
def test_one_changed_byte_of_a_message_is_found_and_named(
    messages: list[Recorded], topic: str
) -> None:
    changed = list(messages)
    at = [i for i, message in enumerate(messages) if message.topic == f"/{topic}"][123]
    data = bytearray(messages[at].data)
    data[-9] ^= 1
    changed[at] = dataclasses.replace(messages[at], data=bytes(data))
    (mission,) = Replay(changed).missions()
    assert f", /{topic}" in mission.difference


def test_a_recorder_that_is_killed_leaves_a_bag_that_can_be_read(
    bag: Bag, messages: list[Recorded]
) -> None:
    reports = [
        recorded.data for recorded in read_bag(bag.killed) if recorded.topic == "/step_report"
    ]
    assert (
        reports
        == [message.data for message in messages if message.topic == "/step_report"][: len(reports)]
    )
    assert reports


def test_a_disk_that_is_full_ends_the_recording_and_nothing_else(bag: Bag) -> None:
    output, code = bag.limited
    assert code == FAILED
    assert output.count("the recording has ended") == 1 and "File too large" in output
    assert "Traceback" not in output


def test_a_recorder_ends_its_bag_on_sigterm(rig: Rig, tmp_path: Path) -> None:
    path = tmp_path / "commands.mcap"
    recorder = rig.start(
        "recorder", {"bag": str(path), "exclude": ["*/left_out"]}, "-r", "__ns:=/a"
    )
    topics: dict[str, Callable[[], None]] = {}
    for topic, kind in (("/a/latched", String), ("/a/left_out", String), ("/elsewhere", Int8)):
        publisher = rig.node.create_publisher(kind, topic, LATCHED)
        message = kind()
        topics[topic] = lambda p=publisher, m=message: p.publish(m)
        topics[topic]()
    rig.until(lambda: path.exists() and any(m.topic == "/a/latched" for m in written(path)))
    recorder.signal(signal.SIGTERM)
    assert recorder.wait() == 0, recorder.output
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert {channel.topic for channel in summary.channels.values()} == {"/a/latched"}


def test_a_recorder_says_what_it_missed(rig: Rig, tmp_path: Path) -> None:
    path = tmp_path / "late.mcap"
    recorder = rig.start("recorder", {"bag": str(path)}, "-r", "__ns:=/a")
    rig.until(lambda: "recording /a" in recorder.output, "a recorder")
    publisher = rig.node.create_publisher(Int8, "/a/counter", RELIABLE)
    published = 0

    def is_recorded() -> bool:
        nonlocal published
        publisher.publish(Int8())
        published += 1
        return path.exists() and count(path, "/a/counter") > 0

    rig.until(is_recorded, "a message in the bag")
    rig.until(lambda: publisher.wait_for_all_acked(), "the last message at the recorder")
    recorder.signal(signal.SIGTERM)
    assert recorder.wait() == 0, recorder.output
    missed = published - count(path, "/a/counter")
    assert missed > 0
    assert f"{missed} message" in recorder.output and f"/a/counter {missed}" in recorder.output

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A thousand messages that mean no good, over DDS."""

from __future__ import annotations

import itertools
import random
from collections import Counter

import numpy as np
import pytest
from geometry_msgs.msg import PoseArray, PoseStamped
from hostile_messages import GRID_SIZE, hostile
from nav_msgs.msg import OccupancyGrid
from rig import Rig, Sim, cells, content
from sensor_msgs.msg import Image
from std_msgs.msg import Int32MultiArray, String

from dsse_ros.mission.run.mission import Mission
from dsse_ros.search.environments.factories import parallel_env
from msg_adapters.images import image_to_probability

UP, DOWN, SEARCH = 2, 3, 4
MESSAGES = 1000
SCENARIO = {
    "grid_size": GRID_SIZE, "num_drones": 3, "person_initial_position": (7, 7), "sigma": 2.0,
    "vector": (-0.4, -0.3), "timestep_limit": 50,
}  # fmt: skip
SEED = 21


@pytest.fixture(scope="module")
def sim(rig: Rig) -> Sim:
    return rig.sim(SCENARIO | {"seed": SEED})


@pytest.fixture(scope="module")
def mission() -> Mission:
    """The same mission, which nobody disturbs."""
    return Mission(parallel_env(**SCENARIO), SEED)  # type: ignore[arg-type]


def test_a_thousand_hostile_messages_change_nothing_and_each_is_counted(
    sim: Sim, mission: Mission
) -> None:
    # The third drone leaves the grid, and the second has a command already.
    sim.fly(SEARCH, SEARCH, UP)
    sim.command(1, DOWN)
    before = sim.health_when(lambda h: h["missing_drones"] == "drone0")
    seen, report = len(sim.reports), content(sim.reports.last)
    grid = sim.rig.first(OccupancyGrid, "probability_grid")
    image = sim.rig.first(Image, "probability")
    poses = list(sim.rig.first(PoseArray, "drones").poses)

    messages = list(itertools.islice(hostile(random.Random(0)), MESSAGES))
    # No listener keeps more than ten messages of a topic that it had no time for yet.
    in_flight: Counter[str] = Counter()
    for topic, message, _ in messages:
        if in_flight[topic] == 4:
            sim.wait_until_quiet()
            in_flight.clear()
        in_flight[topic] += 1
        sim.talk(type(message), topic).publish(message)

    health = sim.health_when(lambda h: int(h["rejected"]) >= MESSAGES)
    counted = {k.removeprefix("rejected."): int(v) for k, v in health.items() if "rejected." in k}
    assert counted == Counter(reason for _, _, reason in messages)
    assert int(health["rejected"]) == sum(counted.values()) == MESSAGES
    assert len(counted) == 8
    assert health["level"] == b"\x01"
    for reason in (" must be ", "drone2 is terminated"):
        sim.rig.until(lambda reason=reason: reason in sim.process.output, "the line")

    for name in ("step", "mission", "missing_drones", "drones_in_flight", "pos"):
        assert health[name] == before[name]
    assert len(sim.reports) == seen
    assert content(sim.reports.last) == report
    assert sim.rig.first(OccupancyGrid, "probability_grid") == grid
    assert sim.rig.first(Image, "probability") == image
    assert list(sim.rig.first(PoseArray, "drones").poses) == poses


def test_after_them_the_mission_goes_on_as_if_nothing_had_been(sim: Sim, mission: Mission) -> None:
    mission.command_all([SEARCH, SEARCH, UP])
    mission.advance("search")
    seen = len(sim.reports)
    # The command given before them still stands.
    sim.command(0, DOWN)
    for actions in ([DOWN, DOWN, SEARCH], [SEARCH, DOWN, SEARCH], [1, 1, SEARCH]):
        if actions != [DOWN, DOWN, SEARCH]:
            sim.joint(*actions)
        report = sim.next_report(seen)
        seen += 1
        mission.command_all(actions)
        result = mission.advance("search")
        assert cells(report) == [tuple(cell) for cell in result.cells.tolist()]
        assert report["reward"].tolist() == result.rewards.tolist()
        assert report["found"].tolist() == result.found.tolist()
        image = image_to_probability(sim.rig.first(Image, "probability"))
        assert np.array_equal(image, mission.env.probability)


def test_bytes_that_are_no_message_are_dropped(sim: Sim) -> None:
    begin = b"\x00\x01\x00\x00"
    names = sim.talk(String, "drone0/cmd_action_name")
    joints = sim.talk(Int32MultiArray, "joint_action")
    poses = sim.talk(PoseStamped, "drone0/command_pose")
    sim.reset()
    before = int(sim.health()["rejected"])
    for publisher, raw in (
        (names, b"\x00"),
        (names, begin),
        (names, b"\xff" * 8),
        (names, begin + b"\xff\xff\xff\x7fabc"),
        (joints, begin + b"\x01\x00\x00\x00\xff\xff\xff\xff"),
        (poses, begin + bytes(8) + b"\xff\xff\xff\x0fmap\x00"),
        # These are messages, if poor ones.
        (names, begin + b"\x05\x00\x00\x00\xff\xfe\xfd\xfc\x00"),
        (names, begin + b"\x06\x00\x00\x00up\x00up\x00"),
    ):
        publisher.publish(raw)
        sim.wait_until_quiet()
    health = sim.health()
    assert health["step"] == "0" and int(health["rejected"]) == before + 1
    # What follows a zero in a text is no part of it.
    assert health["missing_drones"] == "drone1, drone2"

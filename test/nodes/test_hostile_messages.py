# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A thousand messages that mean no good, over DDS."""

from __future__ import annotations

import array
import itertools
import math
import random
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseArray, PoseStamped
from nav_msgs.msg import Path
from nav_msgs.srv import GetMap
from rig import Rig, Sim, cells, content
from sensor_msgs.msg import Image
from std_msgs.msg import Int8, Int32MultiArray, String

from dsse_ros.mission.mission import Mission
from dsse_ros.search import parallel_env
from msg_adapters.images import image_to_probability

UP, DOWN, SEARCH = 2, 3, 4
MESSAGES = 1000
SCENARIO = {
    "grid_size": 8, "num_drones": 3, "person_initial_position": (7, 7), "sigma": 2.0,
    "vector": (-0.4, -0.3), "timestep_limit": 50,
}  # fmt: skip
SEED = 21
SIDE_M = 8 * 130.0

Hostile = tuple[str, Any, str]
"""Topic, message and the reason for which it is refused."""

NAMES = (
    "", "SEARCH", "Search", " search", "search ", "search\n", "lef", "leftright", "4", "None",
    "поиск", "検索", "é", "e\u0301", "\u202esearch", "search\u200b", "😀" * 5000, "x" * 100_000,
    "'; DROP TABLE drones; --", "%s%n", "{0}", "\x01\x7f", "🏴󠁧󠁢󠁥󠁮󠁧󠁿",
)  # fmt: skip
FRAMES = ("", "odom", "Map", "map ", "/map", "drone0/base_link", "m" * 10_000, "карта")
ODD = (math.nan, math.inf, -math.inf)
OUTSIDE = (1e308, -1e308, -1e-9, SIDE_M, SIDE_M + 1e-9, -5.0, 1e19)


def pose(frame: str = "map", **position: float) -> PoseStamped:
    made = PoseStamped()
    made.header.frame_id = frame
    made.pose.position.x = made.pose.position.y = 65.0
    for axis, value in position.items():
        part = made.pose.position if axis in "xyz" else made.pose.orientation
        setattr(part, axis[-1], value)
    return made


def path(*poses: PoseStamped, frame: str = "map") -> Path:
    made = Path(poses=list(poses))
    made.header.frame_id = frame
    return made


def hostile(draw: random.Random) -> Iterator[Hostile]:
    """Yield messages without end, each with its reason; drone 2 is out of the search."""
    for turn in itertools.count():
        drone = draw.randrange(2)
        name = f"drone{drone}"
        number = draw.choice([*range(-128, 0), *range(5, 128)])
        yield f"{name}/cmd_action", Int8(data=number), "unknown_action"
        yield f"{name}/cmd_action_name", String(data=NAMES[turn % len(NAMES)]), "unknown_action"
        odd = {draw.choice(["x", "y", "z", "qx", "qy", "qz", "qw"]): draw.choice(ODD)}
        far = {draw.choice("xy"): draw.choice(OUTSIDE)}
        foreign = draw.choice(FRAMES)
        yield f"{name}/command_pose", pose(**odd), "not_finite"
        yield f"{name}/command_pose", pose(**far), "outside_grid"
        yield f"{name}/command_pose", pose(foreign), "foreign_frame"
        good = [pose() for _ in range(draw.randrange(3))]
        yield f"{name}/command_path", path(), "empty_path"
        yield f"{name}/command_path", path(*good, frame=foreign), "foreign_frame"
        yield f"{name}/command_path", path(*good, pose("odom")), "foreign_frame"
        yield f"{name}/command_path", path(*good, pose(**odd)), "not_finite"
        yield f"{name}/command_path", path(*good, pose(**far)), "outside_grid"
        if turn % 40 == 0:
            yield f"{name}/command_path", path(*[pose()] * 10_001), "path_too_long"
        step = draw.choice([0, 2, 3, -1, 2**31 - 1, -(2**31)])
        yield "joint_action", joint(step, SEARCH, SEARCH, SEARCH), "stale_step"
        other = draw.choice([0, 2, -1, 2**31 - 1, -(2**31)])
        yield "joint_action", joint(other, 1, SEARCH, SEARCH, SEARCH), "stale_mission"
        size = draw.choice([0, 1, 2, 3, 6, 100_000])
        yield "joint_action", joint(*[1] * size), "wrong_size"
        bad = draw.choice([-1, 5, 127, 256, 2**31 - 1, -(2**31)])
        pair = [SEARCH, bad] if turn % 2 else [bad, SEARCH]
        yield "joint_action", joint(1, *pair, SEARCH), "unknown_action"
        yield "drone2/cmd_action", Int8(data=draw.randrange(5)), "drone_terminated"
        yield "drone2/cmd_action_name", String(data="search"), "drone_terminated"
        yield "drone2/command_pose", pose(), "drone_terminated"
        yield "drone2/command_path", path(pose()), "drone_terminated"


def joint(*numbers: int) -> Int32MultiArray:
    return Int32MultiArray(data=array.array("i", numbers))


@pytest.fixture(scope="module")
def sim(rig: Rig) -> Sim:
    values = {name: list(v) if isinstance(v, tuple) else v for name, v in SCENARIO.items()}
    return rig.sim(values | {"seed": SEED})


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
    grid, image = sim.call(GetMap, "get_map").map, sim.rig.first(Image, "probability")
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
    assert len(counted) >= 9
    assert health["level"] == b"\x01"
    for reason in ("is not allowed", "drone2 is terminated"):
        assert reason in sim.process.output

    for name in ("step", "mission", "missing_drones", "drones_in_flight", "pos"):
        assert health[name] == before[name]
    assert len(sim.reports) == seen
    assert content(sim.reports.last) == report
    assert sim.call(GetMap, "get_map").map == grid
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
    paths = sim.talk(Path, "drone0/command_path")
    sim.reset()
    before = int(sim.health()["rejected"])
    for publisher, raw in (
        (names, b"\x00"),
        (names, begin),
        (names, b"\xff" * 8),
        (names, begin + b"\xff\xff\xff\x7fabc"),
        (joints, begin + b"\x01\x00\x00\x00\xff\xff\xff\xff"),
        (paths, begin + bytes(8) + b"\x02\x00\x00\x00a\x00\x00\x00\xff\xff\xff\x0f"),
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

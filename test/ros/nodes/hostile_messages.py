# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages that mean no good, each with the reason for which it has to be refused."""

from __future__ import annotations

import array
import itertools
import math
import random
from collections.abc import Iterator
from typing import Any

from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Int32MultiArray, String

SEARCH = 4
GRID_SIZE = 8
SIDE_M = GRID_SIZE * 130.0

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


def hostile(draw: random.Random) -> Iterator[Hostile]:
    """Yield messages without end, each with its reason; drone 2 is out of the search."""
    for turn in itertools.count():
        drone = draw.randrange(2)
        name = f"drone{drone}"
        yield f"{name}/cmd_action_name", String(data=NAMES[turn % len(NAMES)]), "unknown_action"
        odd = {draw.choice(["x", "y", "z", "qx", "qy", "qz", "qw"]): draw.choice(ODD)}
        far = {draw.choice("xy"): draw.choice(OUTSIDE)}
        foreign = draw.choice(FRAMES)
        yield f"{name}/command_pose", pose(**odd), "not_finite"
        yield f"{name}/command_pose", pose(**far), "outside_grid"
        yield f"{name}/command_pose", pose(foreign), "foreign_frame"
        step = draw.choice([0, 2, 3, -1, 2**31 - 1, -(2**31)])
        yield "joint_action", joint(1, step, SEARCH, SEARCH, SEARCH), "stale_step"
        other = draw.choice([0, 2, -1, 2**31 - 1, -(2**31)])
        yield "joint_action", joint(other, 1, SEARCH, SEARCH, SEARCH), "stale_mission"
        size = draw.choice([0, 1, 2, 3, 4, 6, 100_000])
        yield "joint_action", joint(*[1] * size), "wrong_size"
        bad = draw.choice([-1, 5, 127, 256, 2**31 - 1, -(2**31)])
        pair = [SEARCH, bad] if turn % 2 else [bad, SEARCH]
        yield "joint_action", joint(1, 1, *pair, SEARCH), "unknown_action"
        yield "drone2/cmd_action_name", String(data="search"), "drone_terminated"
        yield "drone2/command_pose", pose(), "drone_terminated"


def joint(*numbers: int) -> Int32MultiArray:
    return Int32MultiArray(data=array.array("i", numbers))

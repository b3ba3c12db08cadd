# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""MAVLink's numbers come from pymavlink, which has them from MAVLink's own definitions."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dsse_ros.vehicles.mission_items import items as mission_items

ROOT = Path(__file__).resolve().parents[3]
FILES = sorted((ROOT / "dsse_ros/vehicles/control").glob("*.py"))
MAVLINKS = [n for n in dir(mavlink) if re.match("MAV|POSITION_|EKF_|ESTIMATOR_|COPTER_|SPEED_", n)]


def typed(code: str) -> list[str]:
    """Return names of MAVLink in the code that are given a number as such."""
    found = []
    for node in ast.walk(ast.parse(code)):
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        names = [n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)]
        numbers = [
            n
            for n in ast.walk(node.value)
            if isinstance(n, ast.Constant) and type(n.value) in (int, float)
        ]
        for name in names:
            suffix = f"_{name.strip('_')}"
            if numbers and len(suffix) > 6 and any(one.endswith(suffix) for one in MAVLINKS):
                found.append(name)
    return found


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_no_number_of_mavlink_is_typed_by_hand(file: Path) -> None:
    assert typed(file.read_text()) == []


def test_mission_items_which_do_without_pymavlink_have_the_same_numbers() -> None:
    commands = {n: v for n, v in vars(mission_items).items() if re.match("NAV_|FRAME_", n)}
    assert len(commands) >= 5
    for name, number in commands.items():
        prefix = "MAV_CMD_" if name.startswith("NAV_") else "MAV_"
        assert number == getattr(mavlink, prefix + name), name


@pytest.mark.parametrize(
    "code",
    ["NAV_WAYPOINT = 16", "_DO_SET_MODE, X = 176, 3", "FRAME_GLOBAL_INT: int = 5"],
)
def test_a_number_typed_by_hand_is_seen(code: str) -> None:
    assert typed(code)

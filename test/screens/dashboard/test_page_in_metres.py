# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Drones in metres on the page, in a real browser beside a real simulation."""

from __future__ import annotations

import math
from typing import Any

import pytest
from rig import TIMEOUT_S, Rig
from std_msgs.msg import Float64MultiArray

from dsse_ros.picture.theme import DRONE_COLOURS
from msg_adapters.commands import joint_command_message

pytestmark = pytest.mark.slow

SIDE_M = 2600.0
SIM = {
    "rules.profile": "flight", "person_motion": "constant_drift", "grid_size": 20,
    "particles": 200, "num_drones": 1, "drones_positions": [9, 9], "seed": 3,
    "probability_of_detection": 0.0, "timestep_limit": 100,
}  # fmt: skip
COLOURS = """
(places) => {
  const canvas = document.querySelector('canvas.mission-map');
  const context = canvas.getContext('2d');
  return places.map(([x, y]) => [...context.getImageData(
    Math.round(x * canvas.width), Math.round(y * canvas.height), 1, 1).data].slice(0, 3));
}
"""
"""Colours of the map at shares of its sides."""


def is_like(colour: list[int], wanted: str) -> bool:
    expected = [int(wanted[i : i + 2], 16) for i in (1, 3, 5)]
    return all(abs(part - other) <= 40 for part, other in zip(colour, expected, strict=True))


def place(report: Any) -> tuple[float, float]:
    """Return where the drone is, as shares of the map from the west and the north."""
    return float(report["x"][0]) / SIDE_M, 1.0 - float(report["y"][0]) / SIDE_M


def test_a_drone_points_ahead_where_it_is_at_the_end_of_its_path_in_its_strip(
    rig: Rig, browser: Any, address: str
) -> None:
    page = browser.new_page(viewport={"width": 1024, "height": 900}, reduced_motion="reduce")
    page.set_default_timeout(TIMEOUT_S * 1000)
    page.goto(address)
    sim = rig.sim(SIM)
    canvas = "document.querySelector('canvas.mission-map')"
    for turn in (0.0, 0.25, -0.4, 0.0):
        step, seen = sim.step_number, len(sim.reports)
        before = place(sim.report)
        talker = sim.talk(Float64MultiArray, "joint_command")
        talker.publish(joint_command_message(sim.search[1], step, [(turn, 1.0)]))
        report = sim.next_report(seen)
        page.wait_for_function(f"{canvas}?.dataset.step === '{step + 1}'")
        side = page.evaluate(f"{canvas}.clientWidth")
        size, heading = min(max(0.42 * side / 20, 6), 11) / side, float(report["heading"][0])
        x, y = place(report)
        sin, cos = size * math.sin(heading), size * math.cos(heading)
        wings = [
            (x + right * cos - 0.6 * sin, y + right * sin + 0.6 * cos) for right in (-0.47, 0.47)
        ]
        for colour in page.evaluate(COLOURS, wings):
            assert is_like(colour, DRONE_COLOURS[0]), (turn, colour)
        # Half of the way back, on the path, and beside it in the strip and out of it.
        middle = (before[0] + x) / 2, (before[1] + y) / 2
        beside = [
            (middle[0] + far * math.cos(heading), middle[1] + far * math.sin(heading))
            for far in (-1.0 / side, 0.0, 1.0 / side, 50.0 / SIDE_M, 90.0 / SIDE_M)
        ]
        *path, strip, sea = page.evaluate(COLOURS, beside)
        assert any(is_like(colour, DRONE_COLOURS[0]) for colour in path)
        assert sum(strip) < sum(sea) - 60
    page.close()

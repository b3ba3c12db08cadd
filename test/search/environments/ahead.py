# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A sensor that looks ahead while it flies, and at its own cell in a search."""

from __future__ import annotations

from typing import Any

from dsse_ros.world.sensors.sensor import Look, Sensor


def _looks(scenario: Any, _searcher: Any, action: str, heading: tuple[int, int]) -> list[Look]:
    multipliers = scenario.person_pod_multipliers
    if action == "search":
        return [Look(0, 0, tuple(min(m, 1.0) for m in multipliers), false_alarms=0.1)]
    pods = tuple(min(0.3 * m, 1.0) for m in multipliers)
    return [Look(k * heading[0], k * heading[1], pods) for k in (1, 2, 3)]


AHEAD = Sensor("looks three cells ahead", _looks)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sensor of the paper: a search sees the drone's cell, and moves see nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dsse_ros.world.sensors.sensor import SEARCH, Look, Sensor, looks_with


def looks(scenario: Any, _searcher: Any, action: str, _heading: tuple[int, int]) -> Sequence[Look]:
    """Return one look at the drone's cell for a search, no look for other actions."""
    if action != SEARCH:
        return ()
    return looks_with({(0, 0): scenario.probability_of_detection}, scenario)


OWN_CELL = Sensor("sees its cell when it searches", looks)

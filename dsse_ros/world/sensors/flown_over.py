# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A sensor that also sees the cells that a drone flies over."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dsse_ros.world.sensors import own_cell
from dsse_ros.world.sensors.lateral_range import LateralRange
from dsse_ros.world.sensors.sensor import SEARCH, Look, Sensor


def looks(scenario: Any, searcher: Any, _action: str, heading: tuple[int, int]) -> Sequence[Look]:
    """Return one look at the drone's cell for every action, as for a search."""
    return own_cell.looks(scenario, searcher, SEARCH, heading)


def lateral(scenario: Any, _searcher: Any) -> LateralRange:
    """Return the POD of a strip as wide as a cell."""
    return LateralRange(scenario.cell_size / 2, scenario.probability_of_detection)


FLOWN_OVER = Sensor(
    "sees its cell when it searches, and the cell that a move enters", looks, lateral
)

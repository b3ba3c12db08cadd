# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A sensor that also sees the cells that a drone flies over."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dsse_ros.sensors import own_cell
from dsse_ros.sensors.sensor import SEARCH, Look, Sensor


def looks(scenario: Any, searcher: Any, _action: str, heading: tuple[int, int]) -> Sequence[Look]:
    """Return one look at the drone's cell for every action, as for a search."""
    return own_cell.looks(scenario, searcher, SEARCH, heading)


FLOWN_OVER = Sensor("sees its cell when it searches, and the cell that a move enters", looks)

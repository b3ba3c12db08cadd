# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The contract of a sensor: which cells an action looks at, and how well."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple


class Look(NamedTuple):
    """A cell that an action looks at.

    Attributes:
        dx: How far it is to the east of the drone, once the action is done, in cells.
        dy: How far it is to the south.
        pods: (P,) the probability of detecting each person who is in it, 0 to 1.
        false_alarms: Probability that a look that finds nobody reports somebody.
    """

    dx: int
    dy: int
    pods: tuple[float, ...]
    false_alarms: float = 0.0


LooksOf = Callable[[Any, Any, str, tuple[int, int]], Sequence[Look]]
"""looks(scenario, searcher, action, heading) returns what an action looks at, at most `MAX_LOOKS`.

It is called for a scenario with its `ResolvedScenario`, the `Searcher` of the drone with nothing
left to derive, the name of the action, and where that leads to as (dx, dy) in cells, (0, 0) if it
stays."""


class Sensor(NamedTuple):
    """A sensor.

    Attributes:
        doc: What it sees, without a subject.
        looks: Returns what an action looks at.
    """

    doc: str
    looks: LooksOf


MAX_LOOKS = 64
"""Of an action: a step notes in a number of 64 bits which of them have found somebody."""

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The contract of a sensor: the cells that an action looks at, and the PODs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from dsse_ros.world.sensors.lateral_range import LateralRange

SEARCH = "search"
"""Name of the action that searches; all others are moves."""


class Look(NamedTuple):
    """A cell that an action looks at.

    Attributes:
        dx: Offset to the east of the drone after the action, in cells.
        dy: Offset to the south, in cells.
        pods: (P,) the probability of detecting each person in the cell, 0 to 1.
        false_alarms: Probability that a look that finds nobody reports somebody.
    """

    dx: int
    dy: int
    pods: tuple[float, ...]
    false_alarms: float = 0.0


LooksOf = Callable[[Any, Any, str, tuple[int, int]], Sequence[Look]]
"""looks(scenario, searcher, action, heading) returns the looks of an action, at most `MAX_LOOKS`.

Arguments are the `ResolvedScenario`, the drone's `Searcher` with nothing left to derive, the name
of the action, and its move (dx, dy) in cells, (0, 0) if the drone stays. A scenario that the sensor
cannot see in raises `ValueError`, "field must be ..., got ..."."""


def looks_with(pods: Mapping[tuple[int, int], float], scenario: Any) -> list[Look]:
    """Return looks at cells (dx, dy) with these PODs times the multiplier of each person."""
    multipliers = scenario.person_pod_multipliers
    return [
        Look(*cell, tuple(min(m * pod, 1.0) for m in multipliers)) for cell, pod in pods.items()
    ]


LateralRangeOf = Callable[[Any, Any], LateralRange]
"""lateral(scenario, searcher) returns how a kind of drone sees what it passes; see `LooksOf`."""


class Sensor(NamedTuple):
    """A sensor.

    Attributes:
        doc: What the sensor sees, as a phrase without a subject.
        looks: Function that returns the looks of an action.
        lateral: Function that returns its lateral range curve, for a search in metres; None if it
            sees nothing in passing.
    """

    doc: str
    looks: LooksOf
    lateral: LateralRangeOf | None = None


MAX_LOOKS = 64
"""Limit per action: a step records in 64 bits which looks found somebody."""

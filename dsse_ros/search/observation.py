# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The observation of a drone and its space."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dsse_ros.scenario.rules import Rules


class Observation(NamedTuple):
    """The observation of one drone.

    Attributes:
        position: (2,) integers, the drone's cell (x, y).
        probability: (G, G) float32, the probability of cell [y, x].
    """

    position: NDArray[np.integer[Any]]
    probability: NDArray[np.float32]


AgentObservation = tuple[NDArray[np.integer[Any]], NDArray[np.float32]]
"""Plain tuple that an environment returns per agent; `Observation(*value)` names its parts."""


def observation_space(grid_size: int, rules: Rules) -> spaces.Tuple:  # type: ignore[type-arg]
    """Return the observation space of a drone on a grid with grid_size cells along a side."""
    span, first = [grid_size + 2 * rules.margin] * 2, [-rules.margin] * 2
    return spaces.Tuple(
        (
            spaces.MultiDiscrete(span, start=first),
            spaces.Box(0.0, 1.0, (grid_size, grid_size), np.float32),
        )
    )

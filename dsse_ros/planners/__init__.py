# SPDX-License-Identifier: Apache-2.0
"""Planners: policies from observations to actions, the same for ROS and the PettingZoo env."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.expanding_square import make_expanding_square
from dsse_ros.planners.greedy import Greedy
from dsse_ros.planners.planner import Observation, Planner, PlannerFactory
from dsse_ros.planners.random_moves import RandomMoves
from dsse_ros.planners.sweep import make_sweep

__all__ = ["PLANNERS", "Observation", "Planner", "PlannerFactory", "make_planner"]

PLANNERS: Mapping[str, PlannerFactory] = MappingProxyType(
    {
        "sweep": make_sweep,
        "expanding_square": make_expanding_square,
        "greedy": Greedy,
        "random": RandomMoves,
    }
)
"""The planners by name."""


def make_planner(
    name: str,
    actions: Sequence[str],
    *,
    seed: int = 0,
    area: NDArray[np.bool_] | None = None,
) -> Planner:
    """Return a new planner for one mission.

    Args:
        name: A key of `PLANNERS`.
        actions: Names of the actions by number, as the rules give them.
        seed: Of all that the planner draws.
        area: (G, G) bool [row, col], the cells that are searched; None for the whole grid.

    Raises:
        ValueError: If the name is unknown or an action that the planner needs is missing.
    """
    if not isinstance(name, str) or name not in PLANNERS:
        raise ValueError(f"planner: {name!r} is not known; one of {', '.join(PLANNERS)}")
    return PLANNERS[name](actions, seed=seed, area=area)

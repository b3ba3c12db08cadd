# SPDX-License-Identifier: Apache-2.0
"""Planners: policies from observations to actions, the same for ROS and the PettingZoo env."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsse_ros.planners.belief import make_belief, make_belief_greedy
from dsse_ros.planners.expanding_square import make_expanding_square
from dsse_ros.planners.greedy import Greedy
from dsse_ros.planners.planner import Observation, Planner, PlannerFactory, Search
from dsse_ros.planners.random_moves import RandomMoves
from dsse_ros.planners.sweep import make_sweep

__all__ = [
    "BELIEF_PLANNERS",
    "PLANNERS",
    "PLANNER_NAMES",
    "Observation",
    "Planner",
    "PlannerFactory",
    "Search",
    "make_planner",
    "planner_for",
]

PLANNERS: Mapping[str, PlannerFactory] = MappingProxyType(
    {
        "sweep": make_sweep,
        "expanding_square": make_expanding_square,
        "greedy": Greedy,
        "random": RandomMoves,
    }
)
"""The planners that need to know no more than the actions, by name."""

BELIEF_PLANNERS: Mapping[str, PlannerFactory] = MappingProxyType(
    {
        "belief": make_belief,
        "belief_greedy": make_belief_greedy,
    }
)
"""The planners that know the rules and the scenario too, by name; called with a `Search`."""

PLANNER_NAMES = (*PLANNERS, *BELIEF_PLANNERS)


def planner_for(search: Search, name: str, *, seed: int = 0, **options: Any) -> Planner:
    """Return a planner for missions of an environment, or of any search.

    Args:
        search: An environment, or whatever has its `rules` and its `scenario`. Nothing hidden is
            read from it.
        name: One of `PLANNER_NAMES`.
        seed: Of all that the planner draws.
        options: Of the planner: `BeamOptions` for `belief`, else none.

    Raises:
        ValueError: If the name is unknown or an action that the planner needs is missing.
    """
    if isinstance(name, str) and name in BELIEF_PLANNERS:
        return BELIEF_PLANNERS[name](search, seed=seed, **options)
    area = search.scenario.resolve(search.rules).area_mask
    return make_planner(name, search.rules.actions, seed=seed, area=area, **options)


def make_planner(
    name: str,
    actions: Sequence[str],
    *,
    seed: int = 0,
    area: NDArray[np.bool_] | None = None,
    **options: Any,
) -> Planner:
    """Return a new planner for one mission.

    Args:
        name: A key of `PLANNERS`.
        actions: Names of the actions by number, as the rules give them.
        seed: Of all that the planner draws.
        area: (G, G) bool [row, col], the cells that are searched; None for the whole grid.
        options: Of the planner.

    Raises:
        ValueError: If the name is unknown or an action that the planner needs is missing.
    """
    if not isinstance(name, str) or name not in PLANNERS:
        if isinstance(name, str) and name in BELIEF_PLANNERS:
            raise ValueError(f"planner: {name!r} has to know the rules and the scenario too")
        raise ValueError(f"planner: {name!r} is not known; one of {', '.join(PLANNER_NAMES)}")
    return PLANNERS[name](actions, seed=seed, area=area, **options)

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The numbers of actions and the names of rewards, as DSSE 1.1.9 has them."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from dsse_ros.world.scenario.rules import profile

Actions = Enum(  # type: ignore[misc]
    "Actions",
    {name.upper(): number for number, name in enumerate(profile("v2").actions)},
    module=__name__,
)
"""`Actions.SEARCH.value` is the number of the action search."""


class Reward(NamedTuple):
    """The rewards of a search; `drones_collision` and `search_cell` have no effect."""

    default: float
    leave_grid: float
    exceed_timestep: float
    drones_collision: float
    search_cell: float
    search_and_find: float

# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""How far drones can fly and still come home with their battery reserve."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsse_ros.scenario.action_times import action_times_of_drones
from dsse_ros.scenario.rules import Rules
from dsse_ros.scenario.scenario import ResolvedScenario
from dsse_ros.search.ways_home import ways_home


class Reach:
    """The reach of the drones of a mission.

    Args:
        scenario: A scenario with batteries.
        rules: The rules of the search.
    """

    def __init__(self, scenario: ResolvedScenario, rules: Rules) -> None:
        actions, mask = rules.action_set, scenario.area_mask
        shares = [times.shares for times in action_times_of_drones(scenario, rules)]
        ways = ways_home(actions, mask, scenario.grid_size, scenario.drones_positions, shares)
        self._home = ways.steps * scenario.battery_return + scenario.battery_reserve
        # A planned step may be a move or a search, so it counts as the one that costs more.
        self._step = max(scenario.battery_move, scenario.battery_search)

    def beyond(self, drone: int, battery: float, steps: int) -> NDArray[np.bool_]:
        """Return the cells from which a drone may not get home after steps 1, 2, ..., (H, G, G).

        Args:
            drone: Number of the drone.
            battery: Its charge, percent.
            steps: H.
        """
        left = battery - self._step * np.arange(1, steps + 1)
        beyond: NDArray[np.bool_] = left[:, None, None] < self._home[drone]
        return beyond

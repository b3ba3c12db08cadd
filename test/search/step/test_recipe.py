# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""One function has the rewards of each profile, as docs/rules.md states them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsse_ros.search.step import recipe
from dsse_ros.search.step.constants import constants_of
from dsse_ros.search.step.entities import WORLDS
from dsse_ros.world.scenario.scenario import scenario_and_rules

LIMIT, STEP = 100, 25
HALF_A_PERCENT, ONE_PERCENT, A_TENTH = 0.005, 0.01, 0.1
PAPER: dict[tuple[int, float], float] = {
    (recipe.MOVED, 0.0): 1.0,
    (recipe.LEFT_GRID, 0.0): -100_000.0,
    (recipe.SEARCHED, HALF_A_PERCENT): -100.0,
    (recipe.SEARCHED, ONE_PERCENT): 100.0,
    (recipe.SEARCHED, A_TENTH): 1000.0,
    (recipe.FOUND, 1.0): 17_500.0,
    (recipe.FOUND, 2.0): 35_000.0,
    (recipe.OUT_OF_TIME, 7.0): -100_000.0,
    (recipe.COLLIDED, 0.0): -100_000.0,
}
REWARDS: dict[str, dict[tuple[int, float], float]] = {
    "paper": PAPER,
    "v1": {
        **PAPER,
        (recipe.SEARCHED, ONE_PERCENT): -100.0,
        (recipe.FOUND, 1.0): 175_000.0,
        (recipe.FOUND, 2.0): 350_000.0,
        (recipe.OUT_OF_TIME, 7.0): -100_007.0,
    },
    "v2": {
        **dict.fromkeys(PAPER, 0.0),
        (recipe.FOUND, 1.0): 1.75,
        (recipe.FOUND, 2.0): 3.5,
    },
    "sea": PAPER,
}


@pytest.mark.parametrize("profile", REWARDS)
def test_the_table_of_rewards_is_that_of_the_profile(profile: str) -> None:
    scenario, rules = scenario_and_rules(rules=profile, timestep_limit=LIMIT)
    constants = constants_of(scenario.resolve(rules), rules)[0]
    world: Any = np.zeros(1, WORLDS)[0]
    world["t"] = STEP
    reward = recipe.reward_of.py_func
    found = {
        (event, amount): reward(
            np.rec.array(constants, constants.dtype)[()], np.rec.array(world, world.dtype)[()],
            None, event, amount,
        )
        for event, amount in REWARDS[profile]
    }  # fmt: skip
    assert found == pytest.approx(REWARDS[profile])

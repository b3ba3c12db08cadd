# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A recorded mission flown again, for its pictures."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dsse_ros.mission.mission_log import MissionRecord
from dsse_ros.search import Rules
from dsse_ros.search.mission_view import MissionView
from dsse_ros.search.parallel_env import SearchEnv
from dsse_ros.search.scenario import Scenario
from dsse_ros.search.world import HOLD


def mission_views(
    record: MissionRecord, scenario: Scenario, rules: Rules, *, seed: int, belief: bool
) -> Iterator[MissionView]:
    """Yield what a picture shows of a mission at its start and after each step.

    Args:
        record: Its commands; the same seed and commands give the same mission.
        scenario: What was searched.
        rules: The rules of the search.
        seed: Of the mission.
        belief: Whether the belief is shown instead of the map.

    Raises:
        ValueError: If the drones were elsewhere: the mission is not of that seed and scenario.
    """
    env = SearchEnv(scenario, rules, "ansi", observe="belief" if belief else "map")
    env.reset(seed=seed)
    numbers = {name: number for number, name in enumerate(rules.actions)}
    for step, cells in enumerate(record.tracks.swapaxes(0, 1)):
        if step:
            joint = [numbers.get(name, HOLD) for name in record.commands[:, step].tolist()]
            env.advance(np.array(joint, np.int8))
        if not np.array_equal(env.positions, cells):
            raise ValueError(f"step {step} is not of the mission that began with seed {seed}")
        yield env.view()

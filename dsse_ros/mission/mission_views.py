# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Replay of a recorded mission, for its pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from dsse_ros.mission.mission_log import MissionRecord
from dsse_ros.scenario.scenario import Scenario
from dsse_ros.search import Rules
from dsse_ros.search.parallel_env import SearchEnv
from dsse_ros.search.world import HOLD
from dsse_ros.search.world_beliefs import WorldBeliefs
from dsse_ros.view.mission_view import MissionView


def mission_views(
    record: MissionRecord, scenario: Scenario, rules: Rules, *, seed: int, belief: bool
) -> Iterator[MissionView]:
    """Yield the contents of a mission's pictures at its start and after each step.

    Args:
        record: The commands; the same seed and commands give the same mission.
        scenario: The scenario of the mission.
        rules: The rules of the search.
        seed: Seed of the mission.
        belief: Whether pictures show the belief of `Mission` instead of the map.

    Raises:
        ValueError: If the drones' cells differ: the mission has another seed or scenario.
    """
    env = SearchEnv(scenario, rules, "ansi")
    env.reset(seed=seed)
    beliefs = WorldBeliefs(env.world) if belief else None
    numbers = {name: number for number, name in enumerate(rules.actions)}
    for step, cells in enumerate(record.tracks.swapaxes(0, 1)):
        if step:
            joint = [numbers.get(name, HOLD) for name in record.commands[:, step].tolist()]
            actions = np.array(joint, np.int8)
            if beliefs is not None:
                beliefs.before_step(actions[None])
            env.advance(actions)
            if beliefs is not None:
                beliefs.after_step()
        if not np.array_equal(env.positions, cells):
            raise ValueError(f"step {step} is not of the mission that began with seed {seed}")
        view = env.view()
        if beliefs is not None:
            pos = float(beliefs.pos[0])
            view = replace(view, probability=beliefs.write()[0], pos=pos, belief=True)
        yield view
